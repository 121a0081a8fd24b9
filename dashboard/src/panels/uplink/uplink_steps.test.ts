import { expect, test } from "vitest";
import { STEPS, stepOf } from "./uplink_steps";

test("each step is its own", () => {
  STEPS.forEach((step, i) => expect(stepOf(step)).toBe(i));
});

test("a budget between steps is shown at the nearest", () => {
  expect(STEPS[stepOf(1000)]).toBe(5000);
  expect(STEPS[stepOf(120_000)]).toBe(100_000);
  expect(STEPS[stepOf(170_000)]).toBe(200_000);
  expect(STEPS[stepOf(1e12)]).toBe(50_000_000);
});
