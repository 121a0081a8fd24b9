/** Minutes of a function, laid out over a window: each place has its minute or nothing. */

import type { Stats } from "../api/functions";

const MINUTE_MS = 60_000;

export interface Slot {
  atMs: number;
  invocations: number;
  errors: number;
  throttles: number;
  /** Null: nothing ran. */
  p95Ms: number | null;
}

/** One place for each `perMin` minutes of the window, the newest last: calls add up, the slowest minute stands for all. */
export function slots({ window_s: windowS, series }: Pick<Stats, "window_s" | "series">, nowMs: number, perMin = 1): Slot[] {
  const last = Math.floor(nowMs / MINUTE_MS / perMin);
  const count = Math.max(1, Math.round(windowS / 60 / perMin));
  const found: Slot[] = Array.from({ length: count }, (_, i) => ({ atMs: (last - count + 1 + i) * perMin * MINUTE_MS, invocations: 0, errors: 0, throttles: 0, p95Ms: null }));
  for (const minute of series) {
    const slot = found[Math.floor(Date.parse(minute.at) / MINUTE_MS / perMin) - last + count - 1];
    if (!slot) continue;
    slot.invocations += minute.invocations;
    slot.errors += minute.errors;
    slot.throttles += minute.throttles;
    if (minute.p95_ms !== null) slot.p95Ms = Math.max(slot.p95Ms ?? 0, minute.p95_ms);
  }
  return found;
}

/** The least round number that is at least so much, for the top of a plot: 1, 1.5, 2, 3, 5, 7.5, 10 … */
export function roundTop(most: number): number {
  if (!(most > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  const step = [1, 1.5, 2, 3, 5, 7.5, 10].find((one) => one * power >= most * (1 - 1e-9))!;
  return step * power;
}
