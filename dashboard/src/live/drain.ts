/** How a backlog goes away: its peak, what is left, and when it will be gone at the speed of late. */

export interface Drained {
  leftBytes: number;
  peakBytes: number;
  /** From 0 to 1 since the peak; 1 when nothing is left. */
  progress: number;
  bytesPerS: number;
  /** Seconds until nothing is left; null while it grows or stands still. */
  etaS: number | null;
}

const MEMORY_S = 5;

export class Drain {
  private left = 0;
  private peak = 0;
  private rate = 0;
  private atMs: number | null = null;

  /** The backlog at an instant. */
  feed(atMs: number, bytes: number): Drained {
    if (this.atMs !== null && atMs > this.atMs) {
      const spanS = (atMs - this.atMs) / 1000;
      const weight = 1 - Math.exp(-spanS / MEMORY_S);
      this.rate += weight * ((this.left - bytes) / spanS - this.rate);
    }
    if (bytes === 0) this.rate = this.peak = 0;
    if (bytes > this.peak) {
      this.peak = bytes;
      this.rate = Math.min(this.rate, 0);
    }
    this.left = bytes;
    this.atMs = atMs;
    return this.now();
  }

  now(): Drained {
    const bytesPerS = Math.max(0, this.rate);
    const moves = bytesPerS > this.left / 1e6 && bytesPerS > 0;
    return {
      leftBytes: this.left,
      peakBytes: this.peak,
      progress: this.peak > 0 ? 1 - this.left / this.peak : 1,
      bytesPerS,
      etaS: this.left > 0 && moves ? this.left / bytesPerS : null,
    };
  }
}
