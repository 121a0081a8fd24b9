/** A short state as colour, shape and word. */

import type { ComponentChildren } from "preact";

export type Tone = "good" | "warn" | "bad" | "off";

const SHAPES: Record<Tone, string> = {
  good: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z",
  warn: "M6 .8 11.600 11H.4Z",
  bad: "M1.500 3 3 1.500 6 4.500 9 1.500 10.500 3 7.500 6l3 3L9 10.500l-3-3-3 3L1.500 9l3-3Z",
  off: "M1.500 1.500h9v9h-9Zm2 2v5h5v-5Z",
};

export function Badge({ tone, children }: { tone: Tone; children: ComponentChildren }) {
  return (
    <span class={`badge badge-${tone}`}>
      <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[tone]} fill-rule="evenodd" /></svg>
      {children}
    </span>
  );
}
