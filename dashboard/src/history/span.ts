/** How much time the time bar spans, and which piece of time that is. */

export const SPANS: Record<string, number> = {
  "15m": 900_000,
  "1h": 3_600_000,
  "6h": 21_600_000,
  "24h": 86_400_000,
  "7d": 604_800_000,
};
export const USUAL_SPAN = "1h";

export interface Window {
  startMs: number;
  endMs: number;
}

/** The piece of time around an instant; up to now while that is in it, and always when LIVE. */
export function windowAround(tMs: number | null, spanMs: number, nowMs: number): Window {
  const endMs = tMs === null || tMs > nowMs - spanMs ? nowMs : tMs + spanMs / 2;
  return { startMs: endMs - spanMs, endMs };
}

/** The window that stays while the instant moves in it, so that what is dragged does not run away. */
export function windowFor(last: Window | null, tMs: number | null, spanMs: number, nowMs: number): Window {
  const fits = last && tMs !== null && Math.abs(last.endMs - last.startMs - spanMs) < 1 && tMs >= last.startMs && tMs <= last.endMs;
  return fits ? last : windowAround(tMs, spanMs, nowMs);
}

/** `t` of an address as milliseconds; null for none and for what is no time. */
export function parseMoment(text: string | null): number | null {
  const ms = text ? Date.parse(text) : NaN;
  return Number.isFinite(ms) ? ms : null;
}

/** The span shown around an instant: it ends at the present, and the instant is never nearer to its start. */
export function frameAround(tMs: number, windowMs: number, nowMs: number): Window {
  const endMs = Math.max(tMs, Math.min(tMs + windowMs / 2, nowMs));
  return { startMs: endMs - windowMs, endMs };
}

const STEPS_S = [10, 30, 60, 300, 600, 1800, 3600, 7200, 14400, 43200, 86400];

/** Round instants, not nearer to each other than `leastPx`, that label a strip of `width` pixels. */
export function ticksOf({ startMs, endMs }: Window, width: number, leastPx = 90): number[] {
  const least = ((endMs - startMs) / width) * leastPx;
  const step = 1000 * (STEPS_S.find((seconds) => seconds * 1000 >= least) ?? 172_800);
  const offset = new Date(startMs).getTimezoneOffset() * 60_000;
  const ticks: number[] = [];
  for (let at = Math.ceil((startMs - offset) / step) * step + offset; at <= endMs; at += step) ticks.push(at);
  return ticks;
}

export const xOf = ({ startMs, endMs }: Window, width: number, ms: number) => ((ms - startMs) / (endMs - startMs)) * width;
export const msOf = ({ startMs, endMs }: Window, width: number, x: number) => startMs + (Math.max(0, Math.min(width, x)) / width) * (endMs - startMs);
