/** What the page remembers of each robot's link: round trips of the last minutes, and how its back-fill goes. */

import { signal, type Signal } from "@preact/signals";
import type { Robot } from "../api/types";
import { Drain, type Drained } from "./drain";

export const HISTORY_POINTS = 120;
const STEP_MS = 900; // the agent speaks once a second

export interface LinkHistory {
  rtts: Signal<number[]>;
  drained: Signal<Drained>;
}

interface Remembered extends LinkHistory {
  drain: Drain;
  notedMs: number;
}

const histories = new Map<string, Remembered>();

export function linkHistory(robot: string): LinkHistory {
  return remembered(robot);
}

function remembered(robot: string): Remembered {
  let found = histories.get(robot);
  if (!found) {
    const drain = new Drain();
    found = { rtts: signal([]), drained: signal(drain.now()), drain, notedMs: -Infinity };
    histories.set(robot, found);
  }
  return found;
}

export const backfillBytes = (robot: Robot) => robot.link.classes.reduce((sum, one) => sum + one.backfill_bytes, 0);

/** A robot's newest state came; noted once a second, and while it is online. */
export function noteLink(robot: Robot, atMs: number): void {
  const history = remembered(robot.id);
  if (robot.state !== "online" || atMs - history.notedMs < STEP_MS) return;
  history.notedMs = atMs;
  history.drained.value = history.drain.feed(atMs, backfillBytes(robot));
  if (robot.link.rtt_ms === null) return;
  history.rtts.value = [...history.rtts.peek().slice(1 - HISTORY_POINTS), robot.link.rtt_ms];
}
