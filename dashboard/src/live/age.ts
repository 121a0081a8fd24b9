/** How old a value is and what the page may say about it. Late data is greyed with its age, never shown as current. */

import { signal } from "@preact/signals";

export const STALE_AFTER_MS = 5000;

/** The wall clock, once a second: what ages in view re-render by. */
export const now = signal(Date.now());

export function startClock(): void {
  setInterval(() => {
    now.value = Date.now();
  }, 1000);
}

export function ageText(ageMs: number): string {
  const seconds = Math.max(0, Math.floor(ageMs / 1000));
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86400)} d`;
}

export const isStale = (stampMs: number, atMs: number, limitMs = STALE_AFTER_MS) => atMs - stampMs > limitMs;
