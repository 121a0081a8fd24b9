/** The rates of a robot's topics over the last minutes: a point each time that they are reported. */

import type { Topic } from "../api/types";

export const POINTS = 60;
const TOPICS = 2000;

export class Rates {
  #points = new Map<string, number[]>();

  /** Add the reported rates; topics that are not among them are forgotten. */
  add(topics: readonly Topic[]): void {
    const next = new Map<string, number[]>();
    for (const { topic, type, rate_hz: rate } of topics.slice(0, TOPICS)) {
      const key = `${topic} ${type}`;
      next.set(key, [...(this.#points.get(key) ?? []), rate ?? 0].slice(-POINTS));
    }
    this.#points = next;
  }

  of({ topic, type }: Pick<Topic, "topic" | "type">): number[] {
    return this.#points.get(`${topic} ${type}`) ?? [];
  }
}

/** Where a line of rates ends on top: above its highest point, and a round number, so that it does not jump. */
export function topOf(values: readonly number[]): number {
  const most = Math.max(...values, 1e-9) * 1.15;
  const unit = 10 ** Math.floor(Math.log10(most));
  return [1, 2, 5, 10].map((step) => step * unit).find((step) => step >= most)!;
}
