/** What was expected of a series around an alert: the band to shade, what is out of it, and how far a plot has to reach. */

import type { Alert, BandPoint } from "../../api/alerts";
import type { Window } from "../../history/span";
import { beganMs, endedMs } from "../words";

export interface Expected {
  stampMs: number;
  value: number | null;
  low: number;
  high: number;
  score: number;
}

export const AROUND: Record<string, number> = { "15m": 900_000, "1h": 3_600_000, "6h": 21_600_000 };
const WORDS = Object.keys(AROUND);

/** The shortest span that shows most of an alert. */
export function usualAround(alert: Alert, nowMs: number): string {
  const lastsMs = (endedMs(alert) ?? nowMs) - beganMs(alert);
  return WORDS.find((word) => lastsMs < AROUND[word]! * 0.6) ?? WORDS.at(-1)!;
}

/** The span around the moment, a good third of it before; not after now, and then longer before. */
export function windowOf(momentMs: number, spanMs: number, nowMs: number): Window {
  const endMs = Math.min(nowMs, momentMs + spanMs * 0.62);
  return { startMs: endMs - spanMs, endMs };
}

const FAR = 3;

interface Range {
  low: number;
  high: number;
  /** Of what is near to it: as large as it is, or a part of its values where they hardly change. */
  size: number;
}

function rangeOf(values: readonly (number | null)[]): Range | null {
  const numbers = values.filter((value): value is number => value !== null && Number.isFinite(value));
  if (numbers.length === 0) return null;
  const [low, high] = [Math.min(...numbers), Math.max(...numbers)];
  return { low, high, size: Math.max(high - low, Math.max(Math.abs(low), Math.abs(high)) * 0.05, 1e-9) };
}

/** Whether a number of an alert is on the axis of its series: a check of how fast a value changes has others. */
export function isOnAxis(value: number | null, values: readonly (number | null)[]): boolean {
  const range = rangeOf(values);
  return value === null || range === null || (value > range.low - range.size && value < range.high + range.size);
}

/** The band point by point, in the plot's unit. One that is far from all values on both sides, as while the gateway learns, says nothing. */
export function rememberedOf(points: readonly BandPoint[], values: readonly (number | null)[], factor: number): Expected[] {
  const range = rangeOf(values);
  return points.flatMap(([stampMs, value, least, most, score]) => {
    const [low, high] = [least === null ? -Infinity : least * factor, most === null ? Infinity : most * factor];
    const says = range === null ? Number.isFinite(low) || Number.isFinite(high) : low > range.low - FAR * range.size || high < range.high + FAR * range.size;
    return says ? [{ stampMs, value: value === null ? null : value * factor, low, high, score }] : [];
  });
}

/** The alert's own bounds over all of the plot: what was expected when it was opened. */
export function ownBounds({ low, high }: Pick<Alert, "low" | "high">, shown: Window, factor: number): Expected[] {
  if (low === null && high === null) return [];
  const bounds = { value: null, low: low === null ? -Infinity : low * factor, high: high === null ? Infinity : high * factor, score: 0 };
  return [{ stampMs: shown.startMs, ...bounds }, { stampMs: shown.endMs, ...bounds }];
}

/** From where to where an axis has to reach: all values, and of the band what is not further than a few times that. */
export function reach(values: readonly (number | null)[], band: readonly Expected[]): [number, number] {
  const edges = band.flatMap(({ low, high }) => [low, high]).filter(Number.isFinite);
  const range = rangeOf(values) ?? rangeOf(edges) ?? { low: 0, high: 1, size: 1 };
  const low = Math.min(range.low, ...edges.filter((value) => value > range.low - FAR * range.size));
  const high = Math.max(range.high, ...edges.filter((value) => value < range.high + FAR * range.size));
  const room = Math.max((high - low) * 0.1, range.size * 0.1);
  return [low >= 0 && low - room < 0 ? 0 : low - room, high + room];
}
