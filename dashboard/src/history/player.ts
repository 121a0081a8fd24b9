/** Playing: the instant moves on by itself until it meets the present, which is LIVE. */

import { signal } from "@preact/signals";
import { moment, setMoment } from "./moment";

export const SPEEDS = [1, 4, 16];
export const STEP_MS = 200;
/** This near to the present there is nothing more to play. */
const PRESENT_MS = 2000;

export const speed = signal(1);
export const playing = signal(false);
let timer: ReturnType<typeof setInterval> | undefined;

export function play(): void {
  if (playing.peek() || moment.peek() === null) return;
  playing.value = true;
  let last = performance.now();
  timer = setInterval(() => {
    const at = performance.now();
    const tMs = moment.peek();
    if (tMs === null) return pause();
    const next = tMs + (at - last) * speed.peek();
    last = at;
    if (next < Date.now() - PRESENT_MS) return setMoment(next, { moves: true });
    pause();
    setMoment(null);
  }, STEP_MS);
}

export function pause(): void {
  clearInterval(timer);
  if (!playing.peek()) return;
  playing.value = false;
  setMoment(moment.peek());
}
