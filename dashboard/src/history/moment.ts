/** The time that the page shows: LIVE (null) or an instant, which the address holds as `t`. */

import { batch, computed, effect, signal } from "@preact/signals";
import { rfc3339 } from "../api/history";
import { now } from "../live/age";
import { place, setParam } from "../ui/url";
import { parseMoment } from "./span";

/** Browsers refuse an address that changes more often than about ten times a second. */
export const WRITE_EVERY_MS = 300;

const instant = signal<number | null>(null);
/** The instant shown in milliseconds since the epoch, or null: LIVE. */
export const moment = computed(() => instant.value);
/** What "now" is for everything shown: the instant, else the wall clock. */
export const shownNow = computed(() => instant.value ?? now.value);

/** Whether the instant still moves: a cursor is dragged, or time is played. */
export const moving = signal(false);

let written = "";
let timer: ReturnType<typeof setTimeout> | undefined;

/** Follow the address: whoever opens or goes back to one gets its instant. */
export function startMoment(): void {
  effect(() => {
    const text = place.value.params.get("t") ?? "";
    if (text === written) return;
    written = text;
    instant.value = parseMoment(text);
  });
}

/** Show an instant, or LIVE. While it `moves` the address follows a little later. */
export function setMoment(ms: number | null, { moves = false } = {}): void {
  batch(() => {
    instant.value = ms === null ? null : Math.round(ms);
    moving.value = moves;
  });
  if (moves) timer ??= setTimeout(write, WRITE_EVERY_MS);
  else write();
}

function write(): void {
  clearTimeout(timer);
  timer = undefined;
  const ms = instant.peek();
  const text = ms === null ? "" : rfc3339(ms);
  if (text === written) return;
  written = text;
  setParam("t", text);
}
