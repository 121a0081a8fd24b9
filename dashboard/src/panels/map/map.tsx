/** The map card: the laser scan in the world by the odometry's pose, walls seen so far, the driven trail. */

import { useSignal, useSignalEffect } from "@preact/signals";
import { useRef } from "preact/hooks";
import type { Missing } from "../../api/history_types";
import type { Message } from "../../live/media/decoder";
import { useCanvas } from "../../ui/canvas";
import { useLive } from "../../ui/context";
import { fixed } from "../../ui/format";
import { Card } from "../../ui/parts";
import { palette } from "../../ui/theme";
import { useTopic } from "../../ui/use_topic";
import { lazy } from "../../views/lazy";
import { drawMap } from "./map_draw";
import { MapModel, yawOf, type Pose, type Scan } from "./map_model";
import { MapView } from "./map_view";
import { FADE_EVERY_M, WallTiles } from "../wall_tiles";

const Trail = lazy(async () => (await import("../../history/trail")).Trail, null);

/** Enough to hold a burst of a replay; what is older than that is not needed. */
const DEPTH = 64;
/** At an instant: scans of the seconds before it, and poses on either side of each of them. */
const SCANS_BACK_S = 1.5;
const POSES_BACK_S = 3;
const POSES_AHEAD_S = 0.8;
/** Ink of so far away is of another drive. */
const SAME_WALLS_MS = 1_800_000;

interface Stamp {
  sec: number;
  nanosec: number;
}

interface Odometry {
  header: { stamp: Stamp };
  pose: { pose: { position: { x: number; y: number }; orientation: { x: number; y: number; z: number; w: number } } };
}

interface LaserScan {
  header: { stamp: Stamp };
  angle_min: number;
  angle_increment: number;
  range_min: number;
  range_max: number;
  ranges: Float32Array;
}

/** The message's own stamp: the robot's time, which poses and scans share; else the publisher's. */
const stampOf = (stamp: Stamp, publishedMs: number) =>
  stamp.sec === 0 && stamp.nanosec === 0 ? publishedMs : stamp.sec * 1000 + stamp.nanosec / 1e6;

function toPose(message: Message, publishedMs: number): Pose {
  const { header, pose } = message as unknown as Odometry;
  const { position, orientation } = pose.pose;
  return { stampMs: stampOf(header.stamp, publishedMs), x: position.x, y: position.y, yaw: yawOf(orientation) };
}

function toScan(message: Message, publishedMs: number): Scan {
  const scan = message as unknown as LaserScan;
  return {
    stampMs: stampOf(scan.header.stamp, publishedMs),
    ranges: scan.ranges,
    angleMin: scan.angle_min,
    angleStep: scan.angle_increment,
    rangeMin: scan.range_min,
    rangeMax: scan.range_max,
  };
}

export function MapCard({ robot, namespace, odom, scan }: { robot: string; namespace: string; odom: string; scan: string | null }) {
  const walls = useRef<WallTiles>(null);
  walls.current ??= new WallTiles();
  const model = useRef<MapModel>(null);
  model.current ??= new MapModel((points) => walls.current!.add(points, palette.peek().wall));
  const view = useRef<MapView>(null);
  view.current ??= new MapView();
  const fadedAt = useRef(0);
  const follow = useSignal(true);
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const problem = useSignal("");
  const scanProblem = useSignal("");
  const note = useRef<HTMLSpanElement>(null);

  const { ref, redraw, redrawOnBeat } = useCanvas(({ context, width, height }) => {
    const { current: map } = model;
    if (view.current!.follow && map!.pose) Object.assign(view.current!, { x: map!.pose.x, y: map!.pose.y });
    drawMap({ context, width, height, view: view.current!, colours: palette.peek() }, map!, walls.current!);
    report(ref.current!, note.current, map!);
  });
  useSignalEffect(() => {
    if (palette.value) redraw();
  });
  const changed = () => {
    follow.value = view.current!.follow;
    redraw();
  };
  const begin = (tMs: number, absent: Missing | null) => {
    if (Math.abs(tMs - (model.current!.untilMs ?? tMs)) > SAME_WALLS_MS) walls.current!.clear();
    model.current!.begin(tMs);
    missing.value = absent;
    received.value = null;
    problem.value = scanProblem.value = "";
    redraw();
  };
  const { past } = useLive();
  const heard = past ? redraw : redrawOnBeat; // an instant is shown at once
  const showTrail = (trail: number[]) => {
    model.current!.trail = trail;
    redraw();
  };
  useTopic({ robot, topic: odom, depth: DEPTH, backS: POSES_BACK_S, aheadS: POSES_AHEAD_S, onInstant: begin }, ({ message, error, stampMs }, seenMs) => {
    problem.value = message ? "" : (error ?? "");
    if (!message) return;
    model.current!.addPose(toPose(message, stampMs));
    if (model.current!.travelledM - fadedAt.current > FADE_EVERY_M) {
      fadedAt.current = model.current!.travelledM;
      walls.current!.fade();
    }
    const { untilMs } = model.current!;
    if (untilMs === null ? seenMs - (received.peek() ?? 0) > 1000 : seenMs <= untilMs) received.value = seenMs;
    heard();
  });
  useTopic({ robot, topic: scan ?? "", depth: DEPTH, backS: SCANS_BACK_S, enabled: scan !== null }, ({ message, error, stampMs }) => {
    scanProblem.value = message ? "" : (error ?? "");
    if (!message) return;
    model.current!.addScan(toScan(message, stampMs));
    heard();
  });

  const middle = (event: MouseEvent): [number, number] => {
    const box = ref.current!.getBoundingClientRect();
    return [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
  };
  const zoom = (factor: number) => {
    view.current!.zoom(factor);
    changed();
  };
  return (
    <Card title="Map" kind="map" topic={odom} note={<span ref={note} class="num" />} stampMs={received.value} missing={missing.value}>
      {past && <Trail robot={robot} namespace={namespace} odom={odom} onTrail={showTrail} />}
      {(problem.value || scanProblem.value) && <p class="problem">{problem.value || scanProblem.value}</p>}
      <div class="map">
        <canvas
          ref={ref}
          tabIndex={0}
          role="img"
          aria-label="Map: laser scan, walls seen so far and driven path. Plus and minus zoom, f follows."
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            view.current!.press(event.pointerId, event.clientX, event.clientY);
          }}
          onPointerMove={(event) => {
            if (view.current!.move(event.pointerId, event.clientX, event.clientY)) changed();
          }}
          onPointerUp={(event) => view.current!.lift(event.pointerId)}
          onPointerCancel={(event) => view.current!.lift(event.pointerId)}
          onWheel={(event) => {
            if (!event.ctrlKey && document.activeElement !== event.currentTarget) return;
            event.preventDefault();
            view.current!.zoom(Math.exp(-event.deltaY / 400), ...middle(event));
            changed();
          }}
          onKeyDown={(event) => {
            if (event.key === "+" || event.key === "=") zoom(1.25);
            else if (event.key === "-") zoom(0.8);
            else if (event.key === "f") {
              view.current!.follow = true;
              changed();
            }
          }}
        />
        <div class="map-tools">
          <button type="button" aria-label="Zoom in" onClick={() => zoom(1.4)}>+</button>
          <button type="button" aria-label="Zoom out" onClick={() => zoom(1 / 1.4)}>−</button>
          <button
            type="button"
            onClick={() => {
              const box = walls.current!.box;
              if (box) view.current!.fit(box, ref.current!.clientWidth, ref.current!.clientHeight);
              changed();
            }}
          >
            Fit
          </button>
          <button
            type="button"
            aria-pressed={follow.value}
            onClick={() => {
              view.current!.follow = !view.current!.follow;
              changed();
            }}
          >
            Follow
          </button>
        </div>
      </div>
    </Card>
  );
}

/** What the picture shows, in words and as data for assistive tools and tests; past the virtual DOM, at frame rate. */
function report(canvas: HTMLCanvasElement, note: HTMLElement | null, map: MapModel): void {
  canvas.dataset.atMs = String(map.untilMs ?? "");
  canvas.dataset.seenMs = String(map.seenFrom?.stampMs ?? "");
  if (!map.pose) {
    if (note) note.textContent = "";
    return;
  }
  const { x, y, yaw } = map.pose;
  Object.assign(canvas.dataset, {
    poseX: x.toFixed(3),
    poseY: y.toFixed(3),
    poseYaw: yaw.toFixed(3),
    hits: String(map.hits.length / 2),
    scans: String(map.scans),
    trail: String(map.trail.length / 2),
  });
  if (note) note.textContent = `${fixed(x, 2)}, ${fixed(y, 2)} m · ${fixed((yaw * 180) / Math.PI, 0)}°`;
}
