import { expect, test } from "vitest";
import { Drain } from "./drain";

test("nothing waits", () => {
  const drain = new Drain();
  expect(drain.feed(0, 0)).toEqual({ leftBytes: 0, peakBytes: 0, progress: 1, bytesPerS: 0, etaS: null });
});

test("what grows has no end in sight", () => {
  const drain = new Drain();
  for (let s = 0; s < 10; s++) drain.feed(s * 1000, s * 1000);
  expect(drain.now()).toMatchObject({ leftBytes: 9000, peakBytes: 9000, progress: 0, etaS: null });
});

test("a steady drain is foretold", () => {
  const drain = new Drain();
  for (let s = 0; s <= 20; s++) drain.feed(s * 1000, 100_000 - s * 4000);
  const seen = drain.now();
  expect(seen.progress).toBeCloseTo(0.8);
  expect(seen.bytesPerS).toBeGreaterThan(3800);
  expect(seen.etaS).toBeGreaterThan(4.9);
  expect(seen.etaS).toBeLessThan(5.5);
});

test("a second outage begins anew, and an end is an end", () => {
  const drain = new Drain();
  [100, 50, 0, 10, 400, 300].forEach((kB, s) => drain.feed(s * 1000, kB * 1000));
  expect(drain.now()).toMatchObject({ peakBytes: 400_000, progress: 0.25 });
  expect(drain.feed(7000, 0)).toMatchObject({ progress: 1, peakBytes: 0, etaS: null });
});

test("two values of one instant do no harm", () => {
  const drain = new Drain();
  drain.feed(1000, 500);
  expect(Number.isFinite(drain.feed(1000, 400).bytesPerS)).toBe(true);
});
