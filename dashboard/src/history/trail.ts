/** The path that led to the instant, from the stored series of the robot's position. */

import { useSignalEffect } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { historyApi } from "../api/history";
import type { Ranged } from "../api/history_types";
import { useLive } from "../ui/context";
import { relativeTopic } from "../ui/format";
import { Latest } from "./latest";

/** How much of the path before the instant is drawn. */
export const TRAIL_S = 300;
const POINTS = 700;
/** A silence of this length breaks the path. */
const HOLE_MS = 15_000;
const JUMP_M = 3;

/** x and y in turn, NaN where the path is broken: what MapModel's trail is. */
export function trailOf({ series }: Ranged): number[] {
  const [xs, ys] = ["x", "y"].map((axis) => series.find(({ name }) => name.endsWith(`.position.${axis}`)));
  if (!xs || !ys) return [];
  const yAt = new Map(ys.stamp_ms.map((stamp, i) => [stamp, ys.mean[i]!]));
  const trail: number[] = [];
  let last: [number, number, number] | null = null;
  xs.stamp_ms.forEach((stamp, i) => {
    const x = xs.mean[i]!;
    const y = yAt.get(stamp);
    if (y === undefined) return;
    if (last && (stamp - last[0] > HOLE_MS || Math.hypot(x - last[1], y - last[2]) > JUMP_M)) trail.push(NaN, NaN);
    trail.push(x, y);
    last = [stamp, x, y];
  });
  return trail;
}

/** Call `onTrail` with the path up to the instant whenever it moves; never while LIVE. */
export function useTrail(robot: string, namespace: string, odom: string, onTrail: (trail: number[]) => void): void {
  const { past, at } = useLive();
  const handler = useRef(onTrail);
  handler.current = onTrail;
  const latest = useMemo(() => new Latest<Ranged>((found) => handler.current(trailOf(found)), () => handler.current([])), [robot, odom]);
  useEffect(() => () => latest.close(), [latest]);
  useSignalEffect(() => {
    const tMs = at.value;
    if (!past) return;
    const stem = `${relativeTopic(odom, namespace).replace(/^\//, "").replaceAll("/", ".")}.pose.pose.position`;
    latest.ask((abort) => historyApi.range(robot, [`${stem}.x`, `${stem}.y`], tMs - TRAIL_S * 1000, tMs, POINTS, abort));
  });
}
