/** Points of one line in time: history from the store, then live values, within a window that moves. */

import type { Span } from "../../api/history_types";

export const POINTS_KEPT = 4000;
/** A hole of this length is drawn as a hole. */
export const HOLE_S = 15;

/** Whether something between two instants is known to be lost. */
export const isBroken = (holes: Span[], afterMs: number, untilMs: number) =>
  holes.some(({ from_ms, to_ms }) => from_ms < untilMs && to_ms > afterMs);

export class Timeline {
  times: number[] = [];
  values: (number | null)[] = [];

  constructor(
    private readonly windowS: number,
    private readonly holeS = Math.max(HOLE_S, windowS / 60),
  ) {}

  /** Put history before whatever live values came while it was fetched. */
  prepend(stampsMs: number[], values: (number | null)[], holes: Span[] = []): void {
    const first = this.times[0] ?? Infinity;
    const live = { times: this.times, values: this.values };
    this.times = [];
    this.values = [];
    stampsMs.forEach((stamp, i) => {
      if (stamp / 1000 >= first) return;
      if (i > 0 && isBroken(holes, stampsMs[i - 1]!, stamp)) this.cut();
      this.add(stamp, values[i] ?? null);
    });
    live.times.forEach((time, i) => this.add(time * 1000, live.values[i] ?? null));
  }

  clear(): void {
    this.times = [];
    this.values = [];
  }

  /** Append a value; one that is older than the newest is ignored, a long silence becomes a hole. */
  add(stampMs: number, value: number | null): void {
    const time = stampMs / 1000;
    const last = this.times.at(-1);
    if (last !== undefined && time <= last) return;
    if (last !== undefined && time - last > this.holeS) {
      this.times.push((last + time) / 2);
      this.values.push(null);
    }
    this.times.push(time);
    this.values.push(value);
    this.#forget(time);
  }

  /** The line is broken here, whatever the distance of its points: something between them is lost. */
  cut(): void {
    if (this.values.at(-1) == null) return;
    this.times.push(this.times.at(-1)! + 1e-4);
    this.values.push(null);
  }

  /** The value that held at a time: the newest at or before it, unless a hole lies between. */
  valueAt(time: number): number | null {
    let low = 0;
    let high = this.times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle]! <= time) low = middle + 1;
      else high = middle;
    }
    return low > 0 && time - this.times[low - 1]! <= this.holeS ? this.values[low - 1]! : null;
  }

  #forget(time: number): void {
    let old = 0;
    while (old < this.times.length - POINTS_KEPT || this.times[old]! < time - this.windowS) old += 1;
    if (old > 0) {
      this.times.splice(0, old);
      this.values.splice(0, old);
    }
  }
}
