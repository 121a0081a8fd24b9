/** What the page knows of the fleet: robots, their newest values, and a short memory of CPU load for spark lines. */

import { computed, signal, type Signal } from "@preact/signals";
import type { Robot } from "../api/types";
import { isStale } from "./age";
import { noteLink } from "./link_history";
import type { Stream } from "./stream";

export const SPARK_POINTS = 60;
export const FLEET_SERIES = ["battery_state.percentage", "odom.twist.twist.linear.x", "host.cpu.percent"];

export type Health = "offline" | "attention" | "online";

/** A value that is a number: a series may have others, which no cell can show. */
export interface Sample {
  stamp_ms: number;
  value: number;
}

export const robots = signal<Robot[] | null>(null);
/** Of all robots in view: how many alerts are open, and whether one of them is an error. */
export const alertsOpen = computed(() => {
  const counts = (robots.value ?? []).map(({ alerts }) => alerts);
  return { open: sum(counts.map(({ open }) => open)), error: counts.some(({ error }) => error > 0) };
});
const sum = (numbers: number[]) => numbers.reduce((total, one) => total + one, 0);
const values = new Map<string, Signal<Sample | null>>();
const sparks = new Map<string, Signal<number[]>>();

/** The newest value of a series of a robot; a signal, so that only its cell re-renders. */
export function latest(robot: string, series: string): Signal<Sample | null> {
  return entry(values, `${robot}\n${series}`, () => null);
}

/** The last values of CPU load of a robot. */
export function cpuSpark(robot: string): Signal<number[]> {
  return entry(sparks, robot, () => []);
}

function entry<T>(map: Map<string, Signal<T>>, key: string, initial: () => T): Signal<T> {
  let found = map.get(key);
  if (!found) map.set(key, (found = signal(initial())));
  return found;
}

export function setValue(robot: string, series: string, sample: Sample): void {
  const cell = latest(robot, series);
  if (cell.peek() && cell.peek()!.stamp_ms > sample.stamp_ms) return;
  cell.value = sample;
  if (series !== "host.cpu.percent") return;
  const spark = cpuSpark(robot);
  spark.value = [...spark.peek().slice(1 - SPARK_POINTS), sample.value];
}

/** Follow the fleet: its robots always, and the few series of the fleet table. */
export function followFleet(stream: Stream): void {
  stream.fleet((changed, complete) => {
    const merged = new Map((complete ? [] : (robots.peek() ?? [])).map((robot) => [robot.id, robot]));
    for (const robot of changed) {
      merged.set(robot.id, robot);
      noteLink(robot, Date.now());
      for (const name of FLEET_SERIES) {
        const sample = robot.latest[name];
        if (sample && sample.value !== null && latest(robot.id, name).peek() === null) setValue(robot.id, name, { ...sample, value: sample.value });
      }
    }
    robots.value = [...merged.values()];
  });
  stream.metrics({ robots: "*", series: FLEET_SERIES, max_rate_hz: 2 }, (robot, stampMs, fields) => {
    for (const [name, value] of Object.entries(fields)) {
      if (value !== null) setValue(robot, name, { stamp_ms: stampMs, value });
    }
  });
}

/** What wants a person's eyes on an online robot, in words; empty when nothing does. */
export function concerns(robot: Robot, atMs: number): string[] {
  const found: string[] = [];
  const value = (name: string) => {
    const sample = latest(robot.id, name).peek() ?? robot.latest[name];
    return sample && !isStale(sample.stamp_ms, atMs) ? sample.value : null;
  };
  const battery = value("battery_state.percentage");
  if (robot.alerts.error > 0) found.push("error alert");
  if (battery !== null && battery < 0.2) found.push("battery low");
  const rtt = robot.link.rtt_ms;
  if (rtt !== null && rtt > 500) found.push("slow link");
  if (robot.link.outbox_bytes > 1_000_000) found.push("outbox filling");
  if (robot.link.forks > 0) found.push("outbox copied");
  const cpu = value("host.cpu.percent");
  if (cpu !== null && cpu > 95) found.push("CPU full");
  return found;
}

export function health(robot: Robot, atMs: number): Health {
  if (robot.state !== "online") return "offline";
  return concerns(robot, atMs).length > 0 ? "attention" : "online";
}

const RANK: Record<Health, number> = { offline: 0, attention: 1, online: 2 };

/** Worst first, then by name with numbers in numeric order. */
export function worstFirst(list: Robot[], atMs: number): Robot[] {
  return [...list].sort(
    (a, b) => RANK[health(a, atMs)] - RANK[health(b, atMs)] || a.id.localeCompare(b.id, "en", { numeric: true }),
  );
}
