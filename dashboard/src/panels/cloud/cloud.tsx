/** Point clouds in the round: one of the robot's clouds at a time, the smallest by itself. */

import { useSignal, useSignalEffect, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Missing } from "../../api/history_types";
import type { Topic } from "../../api/types";
import type { Cloud } from "../../live/media/cloud";
import { useLive } from "../../ui/context";
import { relativeTopic } from "../../ui/format";
import { inNextFrame, onBeat, useWork } from "../../ui/paint";
import { Card } from "../../ui/parts";
import { palette } from "../../ui/theme";
import { useTopic } from "../../ui/use_topic";
import { useVisible } from "../../ui/use_visible";
import type { CardProps } from "../card_props";
import { CloudPainter, type Colouring } from "./cloud_gl";
import { CloudView } from "./cloud_view";
import "../../styles/cloud.css";

const QUANTIZED = "metaros_msgs/msg/QuantizedCloud";
const COLOURINGS: Colouring[] = ["height", "intensity", "distance"];
const RATE_HZ = 10;
const LOST = "The graphics card was taken away; the picture comes back by itself.";
const NO_WEBGL = "This browser draws nothing in three dimensions: WebGL 2 is off or missing.";

export function CloudCards({ robot, topics }: CardProps) {
  const sorted = [...topics].sort((a, b) => Number(b.type === QUANTIZED) - Number(a.type === QUANTIZED));
  const chosen = useSignal("");
  const topic = sorted.find((one) => one.topic === chosen.value) ?? sorted[0]!;
  return <CloudCard key={`${robot.id} ${topic.topic}`} robot={robot.id} namespace={robot.namespace} topic={topic.topic} others={sorted} chosen={chosen} />;
}

interface Props {
  robot: string;
  namespace: string;
  topic: string;
  others: Topic[];
  chosen: Signal<string>;
}

function CloudCard({ robot, namespace, topic, others, chosen }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const note = useRef<HTMLSpanElement>(null);
  const painter = useRef<CloudPainter>(null);
  const view = useRef<CloudView>(null);
  view.current ??= new CloudView();
  const shown = useRef<Cloud | null>(null);
  const colouring = useSignal<Colouring>("height");
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const problem = useSignal("");
  const trouble = useSignal("");
  const past = useLive().past !== null;

  const work = useWork(() => {
    if (canvas.current && painter.current) paint(canvas.current, painter.current, view.current!, colouring.peek());
  });
  const redraw = () => inNextFrame(work);
  const show = (cloud: Cloud | null) => {
    if (cloud && !shown.current) view.current!.reset(cloud.distance[1]);
    shown.current = cloud;
    painter.current?.show(cloud);
    report(canvas.current, note.current, cloud);
    (past ? inNextFrame : onBeat)(work);
  };
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    received.value = null;
    if (absent) show(null);
  };
  const enabled = useVisible().value || past; // nobody sees a hidden tab, and clouds are heavy
  useTopic({ robot, topic, cloud: true, maxRateHz: RATE_HZ, enabled, onInstant: begin }, ({ cloud, error }, seenMs) => {
    problem.value = cloud ? "" : (error ?? "no cloud");
    if (!cloud) return;
    if (Math.abs(seenMs - (received.peek() ?? 0)) > 1000) received.value = seenMs;
    show(cloud);
  });
  useEffect(() => begun(canvas.current!, painter, trouble, shown, redraw), []);
  useSignalEffect(() => {
    if (palette.value && colouring.value) redraw();
  });
  const height = () => canvas.current!.clientHeight;
  return (
    <Card title="Points" kind="cloud" topic={topic} note={<span ref={note} class="num" />} stampMs={received.value} missing={missing.value}>
      {(problem.value || trouble.value) && <p class="problem">{problem.value || trouble.value}</p>}
      <div class="cloud">
        <canvas
          ref={canvas}
          tabIndex={0}
          role="img"
          aria-label="Point cloud. Arrows turn it, with shift they move it; plus and minus zoom."
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            view.current!.press(event.pointerId, event.clientX, event.clientY);
          }}
          onPointerMove={(event) => {
            if (view.current!.move(event.pointerId, event.clientX, event.clientY, height(), event.shiftKey || event.buttons === 4)) redraw();
          }}
          onPointerUp={(event) => view.current!.lift(event.pointerId)}
          onPointerCancel={(event) => view.current!.lift(event.pointerId)}
          onWheel={(event) => {
            if (!event.ctrlKey && document.activeElement !== event.currentTarget) return;
            event.preventDefault();
            view.current!.zoom(Math.exp(-event.deltaY / 400));
            redraw();
          }}
          onKeyDown={(event) => {
            if (!view.current!.key(event.key, event.shiftKey, height())) return;
            event.preventDefault();
            redraw();
          }}
        />
        <div class="map-tools">
          {others.length > 1 && (
            <select aria-label="Cloud" value={topic} onChange={(event) => (chosen.value = event.currentTarget.value)}>
              {others.map((one) => (
                <option key={one.topic} value={one.topic}>{relativeTopic(one.topic, namespace)}</option>
              ))}
            </select>
          )}
          {COLOURINGS.map((choice) => (
            <button key={choice} type="button" aria-pressed={choice === colouring.value} onClick={() => (colouring.value = choice)}>
              {choice[0]!.toUpperCase() + choice.slice(1)}
            </button>
          ))}
          <button
            type="button"
            onClick={() => {
              view.current!.reset(shown.current?.distance[1]);
              redraw();
            }}
          >
            Reset
          </button>
        </div>
      </div>
    </Card>
  );
}

/** Paint on the canvas from now on, also after the context was lost; returns how to end it. */
function begun(
  canvas: HTMLCanvasElement,
  painter: { current: CloudPainter | null },
  trouble: Signal<string>,
  shown: { current: Cloud | null },
  redraw: () => void,
): () => void {
  painter.current = CloudPainter.on(canvas);
  if (!painter.current) {
    trouble.value = NO_WEBGL;
    return () => {};
  }
  painter.current.show(shown.current);
  const lost = (event: Event) => {
    event.preventDefault(); // else it never comes back
    trouble.value = LOST;
  };
  const restored = () => {
    painter.current!.restored();
    trouble.value = "";
    redraw();
  };
  canvas.addEventListener("webglcontextlost", lost);
  canvas.addEventListener("webglcontextrestored", restored);
  const observer = new ResizeObserver(redraw);
  observer.observe(canvas);
  return () => {
    canvas.removeEventListener("webglcontextlost", lost);
    canvas.removeEventListener("webglcontextrestored", restored);
    observer.disconnect();
    painter.current?.close();
    painter.current = null;
  };
}

function paint(canvas: HTMLCanvasElement, painter: CloudPainter, view: CloudView, colouring: Colouring): void {
  const density = Math.min(2, devicePixelRatio || 1);
  const [width, height] = [Math.round(canvas.clientWidth * density), Math.round(canvas.clientHeight * density)];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const { surface, line } = palette.peek();
  painter.draw({ view: view.matrix(width, height), colouring, ground: surface, grid: line, density });
  Object.assign(canvas.dataset, { frames: String(Number(canvas.dataset.frames ?? 0) + 1), yaw: view.yaw.toFixed(3), distance: view.distance.toFixed(2), colouring });
}

/** What the picture shows, in words and as data for assistive tools and tests; past the virtual DOM. */
function report(canvas: HTMLCanvasElement | null, note: HTMLElement | null, cloud: Cloud | null): void {
  const drawn = cloud ? cloud.positions.length / 3 : 0;
  if (canvas) Object.assign(canvas.dataset, { points: String(cloud?.total ?? 0), drawn: String(drawn), frame: cloud?.frame ?? "" });
  if (!note) return;
  const some = cloud && drawn < cloud.total * 0.9 ? ` · ${drawn.toLocaleString("en")} drawn` : "";
  note.textContent = cloud ? `${cloud.total.toLocaleString("en")} points${some}` : "";
}
