import { afterEach, beforeEach, expect, test, vi } from "vitest";

const FRAME_MS = 20;
let paint: typeof import("./paint");
let frames: number;
let painted: string[];
const work = (name: string) => () => void painted.push(name);

beforeEach(async () => {
  vi.useFakeTimers();
  frames = 0;
  painted = [];
  vi.stubGlobal("requestAnimationFrame", (draw: () => void) => {
    setTimeout(() => {
      frames += 1;
      draw();
    }, FRAME_MS - (performance.now() % FRAME_MS));
    return 1;
  });
  vi.resetModules();
  paint = await import("./paint");
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test("what comes after a pause is painted in the next frame", () => {
  paint.onBeat(work("map"));
  vi.advanceTimersByTime(FRAME_MS);
  expect(painted).toEqual(["map"]);
});

test("many cards that change at odd times share eight frames a second", () => {
  const cards = ["map", "scan", "imu", "plot"].map(work);
  for (let ms = 0; ms < 10_000; ms += 10) {
    if (ms % 100 < 40) paint.onBeat(cards[(ms % 100) / 10]!);
    vi.advanceTimersByTime(10);
  }
  expect(frames).toBeGreaterThan(65);
  expect(frames).toBeLessThanOrEqual(80);
  expect(painted.filter((name) => name === "plot").length).toBeGreaterThan(frames - 3);
});

test("a camera's frames are its own, and the beat goes with them", () => {
  const [camera, map] = [work("camera"), work("map")];
  for (let ms = 0; ms < 10_000; ms += 10) {
    if (ms % 100 === 0) paint.inNextFrame(camera);
    if (ms % 100 === 50) paint.onBeat(map);
    vi.advanceTimersByTime(10);
  }
  expect(painted.filter((name) => name === "camera").length).toBeGreaterThanOrEqual(99);
  expect(painted.filter((name) => name === "map").length).toBeGreaterThanOrEqual(98);
  expect(frames).toBeLessThanOrEqual(102);
});

test("it is done once however often it is asked for", () => {
  const map = work("map");
  for (const ask of [paint.onBeat, paint.inNextFrame, paint.onBeat]) ask(map);
  vi.advanceTimersByTime(1000);
  expect(painted).toEqual(["map"]);
});

test("a card that fails leaves the others their paint, and is told of", () => {
  const reported: unknown[] = [];
  vi.stubGlobal("reportError", (error: unknown) => reported.push(error));
  const broken = new Error("broken");
  paint.onBeat(() => {
    throw broken;
  });
  paint.onBeat(work("map"));
  vi.advanceTimersByTime(200);
  expect([painted, reported]).toEqual([["map"], [broken]]);
});
