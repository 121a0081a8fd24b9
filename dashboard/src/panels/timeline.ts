/** Points of one line in time: history from the store, then live values, within a window that moves. */

export const POINTS_KEPT = 4000;
/** A hole of this length is drawn as a hole. */
export const HOLE_S = 15;

export class Timeline {
  times: number[] = [];
  values: (number | null)[] = [];

  constructor(private readonly windowS: number) {}

  /** Put history before whatever live values came while it was fetched. */
  prepend(stampsMs: number[], values: (number | null)[]): void {
    const first = this.times[0] ?? Infinity;
    const live = { times: this.times, values: this.values };
    this.times = [];
    this.values = [];
    stampsMs.forEach((stamp, i) => {
      if (stamp / 1000 < first) this.add(stamp, values[i] ?? null);
    });
    live.times.forEach((time, i) => this.add(time * 1000, live.values[i] ?? null));
  }

  /** Append a value; one that is older than the newest is ignored, a long silence becomes a hole. */
  add(stampMs: number, value: number | null): void {
    const time = stampMs / 1000;
    const last = this.times.at(-1);
    if (last !== undefined && time <= last) return;
    if (last !== undefined && time - last > Math.max(HOLE_S, this.windowS / 60)) {
      this.times.push((last + time) / 2);
      this.values.push(null);
    }
    this.times.push(time);
    this.values.push(value);
    let old = 0;
    while (old < this.times.length - POINTS_KEPT || this.times[old]! < time - this.windowS) old += 1;
    if (old > 0) {
      this.times.splice(0, old);
      this.values.splice(0, old);
    }
  }
}
