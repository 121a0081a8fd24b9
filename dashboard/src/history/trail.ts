/** The path that led to the instant, from the stored series of the robot's position. */

import { useSignalEffect } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { historyApi } from "../api/history";
import type { Ranged } from "../api/history_types";
import { useLive } from "../ui/context";
import { relativeTopic } from "../ui/format";
import { Latest } from "./latest";
import { trailOf } from "./path";

/** How much of the path before the instant is drawn. */
const TRAIL_S = 300;
const POINTS = 600;
const AFTER_MS = 200;

interface TrailProps {
  robot: string;
  namespace: string;
  odom: string;
  onTrail: (trail: number[]) => void;
}

/** Shows nothing itself: calls `onTrail` with the path up to the instant whenever that moves. Only the past has one. */
export function Trail({ robot, namespace, odom, onTrail }: TrailProps): null {
  const { at } = useLive();
  const handler = useRef(onTrail);
  handler.current = onTrail;
  const latest = useMemo(() => new Latest<Ranged>((found) => handler.current(trailOf(found)), () => handler.current([])), [robot, odom]);
  useEffect(() => () => latest.close(), [latest]);
  useSignalEffect(() => {
    const tMs = at.value;
    const stem = `${relativeTopic(odom, namespace).replace(/^\//, "").replaceAll("/", ".")}.pose.pose.position`;
    // The scan is what is waited for; the path may come a moment after it.
    const timer = setTimeout(() => latest.ask((abort) => historyApi.range(robot, [`${stem}.x`, `${stem}.y`], tMs - TRAIL_S * 1000, tMs, POINTS, abort)), AFTER_MS);
    return () => clearTimeout(timer);
  });
  return null;
}
