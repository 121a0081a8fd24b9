import { expect, test } from "vitest";
import { MapModel, scanPoints, TRAIL_POINTS, yawOf, type Pose, type Scan } from "./map_model";
import { scaleStep } from "./map_draw";
import { MapView } from "./map_view";

const pose = (stampMs: number, x = 0, y = 0, yaw = 0): Pose => ({ stampMs, x, y, yaw });
const scan = (stampMs: number, ranges: number[]): Scan => ({
  stampMs,
  ranges,
  angleMin: 0,
  angleStep: Math.PI / 2,
  rangeMin: 0.1,
  rangeMax: 10,
});

test("yaw of a quaternion", () => {
  expect(yawOf({ x: 0, y: 0, z: Math.sin(0.35), w: Math.cos(0.35) })).toBeCloseTo(0.7);
});

test("rays become points of the world; what hit nothing is left out", () => {
  const points = scanPoints(scan(0, [1, 10, Infinity, NaN]), pose(0, 2, 3, Math.PI / 2));
  expect(points.length).toBe(2);
  expect(points[0]).toBeCloseTo(2);
  expect(points[1]).toBeCloseTo(4);
});

test("a scan waits for the pose after it and is placed between the two", () => {
  const placed: number[][] = [];
  const model = new MapModel((points) => placed.push([...points]));
  model.addPose(pose(100, 0));
  model.addScan(scan(150, [1, 0, 0, 0]));
  expect(placed).toEqual([]);
  model.addPose(pose(200, 1));
  expect(placed).toHaveLength(1);
  expect(placed[0]![0]).toBeCloseTo(1.5);
  expect(model.scans).toBe(1);
});

test("turning is interpolated the short way around", () => {
  const model = new MapModel(() => {});
  model.addPose(pose(0, 0, 0, 3));
  model.addPose(pose(100, 0, 0, -3));
  expect(model.poseAt(50)!.yaw).toBeCloseTo(Math.PI, 1);
});

test("a scan older than every pose is forgotten", () => {
  const model = new MapModel(() => {});
  model.addScan(scan(1, [1, 1, 1, 1]));
  model.addPose(pose(100));
  model.addPose(pose(200));
  expect(model.scans).toBe(0);
});

test("standing still adds nothing to the trail; being put elsewhere breaks it", () => {
  const model = new MapModel(() => {});
  for (let i = 0; i < 10; i++) model.addPose(pose(i, 0.001 * i));
  expect(model.trail).toEqual([0, 0]);
  model.addPose(pose(20, 9));
  expect(model.trail).toEqual([0, 0, NaN, NaN, 9, 0]);
  expect(model.travelledM).toBeCloseTo(0.009);
});

test("the trail is bounded", () => {
  const model = new MapModel(() => {});
  for (let i = 0; i < TRAIL_POINTS * 1.5; i++) model.addPose(pose(i, i * 0.05));
  expect(model.trail.length).toBeLessThanOrEqual(TRAIL_POINTS * 2);
  expect(model.trail.slice(0, 2)).toEqual([0, 0]);
});

test("zooming keeps what is under the pointer, panning ends following", () => {
  const view = new MapView();
  view.press(1, 0, 0);
  view.move(1, 32, 0);
  expect([view.follow, view.x]).toEqual([false, -1]);
  view.lift(1);
  const under = view.x + 100 / view.scale;
  view.zoom(2, 100, 0);
  expect(view.x + 100 / view.scale).toBeCloseTo(under);
});

test("two fingers pinch", () => {
  const view = new MapView();
  view.press(1, 0, 0);
  view.press(2, 100, 0);
  view.move(2, 200, 0);
  expect(view.scale).toBe(64);
});

test("the scale bar is a round distance", () => {
  expect([scaleStep(32, 110), scaleStep(2, 110), scaleStep(400, 110)]).toEqual([2, 50, 0.2]);
});

test("at an instant the pose is that of the instant, and poses after it only place scans", () => {
  const placed: number[][] = [];
  const model = new MapModel((points) => placed.push([...points]));
  model.addPose(pose(10, 5));
  model.begin(150);
  model.addPose(pose(100, 0));
  model.addScan(scan(150, [1, 0, 0, 0]));
  expect([model.pose!.x, model.hits[0]]).toEqual([0, 1]); // for want of a pose after it, and without ink
  expect(placed).toEqual([]);
  model.addPose(pose(200, 1));
  expect([model.pose!.x, model.hits[0]]).toEqual([0.5, 1.5]);
  expect([placed.length, model.trail]).toEqual([1, [5, 0]]);
  model.begin(900);
  expect([model.pose, model.hits.length]).toEqual([null, 0]);
});
