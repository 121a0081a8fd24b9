import { expect, test } from "vitest";
import { CloudView } from "./cloud_view";

/** Where a point is on a screen from -1 to 1, and how deep. */
function seen(view: CloudView, [x, y, z]: [number, number, number], width = 400, height = 400): [number, number, number] {
  const m = view.matrix(width, height);
  const row = (at: number) => m[at]! * x + m[4 + at]! * y + m[8 + at]! * z + m[12 + at]!;
  return [row(0) / row(3), row(1) / row(3), row(2) / row(3)];
}

test("what is orbited is in the middle, what is above is above", () => {
  const view = new CloudView();
  const [x, y, depth] = seen(view, [0, 0, 0]);
  expect(Math.hypot(x, y)).toBeLessThan(1e-6);
  expect(Math.abs(depth)).toBeLessThan(1);
  expect(seen(view, [0, 0, 1])[1]).toBeGreaterThan(0);
});

test("looking along x from behind, left is left and the far is deeper", () => {
  const view = new CloudView();
  Object.assign(view, { yaw: Math.PI, pitch: 0 });
  expect(seen(view, [0, 1, 0])[0]).toBeLessThan(0);
  expect(seen(view, [5, 0, 0])[2]).toBeGreaterThan(seen(view, [-5, 0, 0])[2]);
});

test("a wide picture does not stretch", () => {
  const view = new CloudView();
  Object.assign(view, { yaw: Math.PI, pitch: 0 });
  expect(seen(view, [0, -1, 0], 800, 400)[0] * 800).toBeCloseTo(seen(view, [0, 0, 1], 800, 400)[1] * 400, 4);
});

test("zoom and pitch have ends", () => {
  const view = new CloudView();
  for (let again = 0; again < 100; again++) {
    view.zoom(2);
    view.orbit(0, 1);
  }
  expect(view.distance).toBeGreaterThan(0);
  expect(view.pitch).toBeLessThan(Math.PI / 2);
  view.zoom(0);
  view.zoom(NaN);
  expect(Number.isFinite(view.distance)).toBe(true);
});

test("a pointer turns, two zoom, one that was never pressed does nothing", () => {
  const view = new CloudView();
  const { yaw, distance } = view;
  expect(view.move(1, 5, 5, 400)).toBe(false);
  view.press(1, 100, 100);
  expect(view.move(1, 150, 100, 400)).toBe(true);
  expect(view.yaw).not.toBe(yaw);
  view.press(2, 200, 100);
  view.move(2, 250, 100, 400);
  expect(view.distance).toBeCloseTo(distance / 2);
  view.lift(2);
  view.lift(1);
  expect(view.move(1, 0, 0, 400)).toBe(false);
});

test("moving along keeps the point under the pointer", () => {
  const view = new CloudView();
  view.press(1, 0, 0);
  view.move(1, 100, -40, 400, true);
  const [x, y] = seen(view, [0, 0, 0]);
  expect([x * 200, y * 200]).toEqual([expect.closeTo(100, 3), expect.closeTo(40, 3)]);
});

test("keys turn, move along and zoom; others are somebody else's", () => {
  const view = new CloudView();
  const { yaw, distance } = view;
  expect(view.key("ArrowLeft", false, 400)).toBe(true);
  expect(view.yaw).not.toBe(yaw);
  expect(view.key("ArrowLeft", true, 400)).toBe(true);
  expect(view.target).not.toEqual([0, 0, 0]);
  expect(view.key("+", false, 400)).toBe(true);
  expect(view.distance).toBeLessThan(distance);
  expect(view.key("Tab", false, 400)).toBe(false);
  view.reset(30);
  expect([view.yaw, view.distance]).toEqual([yaw, 60]);
});
