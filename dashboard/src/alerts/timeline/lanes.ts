/** The timeline's lanes: one for each robot, its alerts beside each other in time, and below each other where they overlap. */

import type { Alert } from "../../api/alerts";
import type { Window } from "../../history/span";
import { beganMs, endedMs, isOver, worstOf } from "../words";

export interface Bar {
  alert: Alert;
  /** Parts of the window, 0 to 1. */
  from: number;
  to: number;
  /** Which of the lane's rows, from 0. */
  row: number;
}

export interface Lane {
  robot: string;
  bars: Bar[];
  rows: number;
}

/** A row takes the next bar this far (of the window) after the one before it. */
const LEAST = 0.012;
export const MOST_ROWS = 4;

/** Robots with something that goes on first, the worst before others, then by name. */
export function lanesOf(alerts: readonly Alert[], { startMs, endMs }: Window): Lane[] {
  const byRobot = new Map<string, Alert[]>();
  for (const alert of alerts) {
    if (beganMs(alert) > endMs || (endedMs(alert) ?? endMs) < startMs) continue;
    const found = byRobot.get(alert.robot);
    if (found) found.push(alert);
    else byRobot.set(alert.robot, [alert]);
  }
  const part = (ms: number) => Math.max(0, Math.min(1, (ms - startMs) / (endMs - startMs)));
  const lanes = [...byRobot].map(([robot, own]) => packed(robot, own.map((alert) => ({ alert, from: part(beganMs(alert)), to: part(endedMs(alert) ?? endMs), row: 0 }))));
  return lanes.sort((a, b) => urgency(a) - urgency(b) || a.robot.localeCompare(b.robot, "en", { numeric: true }));
}

function packed(robot: string, bars: Bar[]): Lane {
  const ends: number[] = [];
  for (const bar of bars.sort((a, b) => a.from - b.from)) {
    const free = ends.findIndex((end) => end + LEAST <= bar.from);
    bar.row = free >= 0 ? free : Math.min(ends.length, MOST_ROWS - 1);
    ends[bar.row] = Math.max(bar.to, bar.from + LEAST);
  }
  return { robot, bars, rows: Math.max(1, ends.length) };
}

function urgency({ bars }: Lane): number {
  const open = bars.map(({ alert }) => alert).filter((alert) => !isOver(alert) && !alert.quiet);
  return open.length === 0 ? 9 : ["error", "warning", "info"].indexOf(worstOf(open));
}
