/** Waiting times between attempts to reconnect: 0.25 s, doubled up to 2 s, back to the start after a success. */

export const FIRST_WAIT_MS = 250;
export const LONGEST_WAIT_MS = 2000;

export class Backoff {
  #next = FIRST_WAIT_MS;

  /** The wait before the coming attempt; the one after it will be longer. */
  next(): number {
    const wait = this.#next;
    this.#next = Math.min(this.#next * 2, LONGEST_WAIT_MS);
    return wait;
  }

  reset(): void {
    this.#next = FIRST_WAIT_MS;
  }
}
