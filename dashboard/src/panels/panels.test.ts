import { expect, test } from "vitest";
import type { Topic } from "../api/types";
import { speedOfKeys, speedOfPointer } from "./teleop_input";
import { plotsOf } from "./plots/plot_table";
import { layoutOf } from "./registry";
import { Timeline } from "./plots/timeline";
import { MAX_ROWS, treeRows } from "./tree_rows";

const LIMITS = { linear: 0.5, angular: 1 };
const topic = (name: string, type: string, publishers = 1) =>
  ({ topic: name, type, publishers, messages: 0, received: 0, encoding: "cdr" }) as Topic;

test("keys: up is forward, left is a positive turn, opposite keys cancel", () => {
  expect(speedOfKeys(["KeyW"], LIMITS)).toEqual({ linear: 0.5, angular: 0 });
  expect(speedOfKeys(["ArrowUp", "KeyA"], LIMITS)).toEqual({ linear: 0.5, angular: 1 });
  expect(speedOfKeys(["KeyW", "KeyS"], LIMITS)).toEqual({ linear: 0, angular: 0 });
  expect(speedOfKeys(["KeyW", "ArrowUp"], LIMITS).linear).toBe(0.5);
});

test("pointer: the middle is a dead zone, the rim is full speed", () => {
  expect(speedOfPointer(0.05, -0.05, LIMITS)).toEqual({ linear: 0, angular: 0 });
  expect(speedOfPointer(0, -1, LIMITS)).toEqual({ linear: 0.5, angular: 0 });
  expect(speedOfPointer(1, 0, LIMITS)).toEqual({ linear: 0, angular: -1 });
});

test("cards by type: a map pairs a scan with the odometry beside it", () => {
  const layout = layoutOf([
    topic("/b/scan", "sensor_msgs/msg/LaserScan"),
    topic("/a/scan", "sensor_msgs/msg/LaserScan"),
    topic("/b/odom", "nav_msgs/msg/Odometry"),
    topic("/b/camera/image/compressed", "sensor_msgs/msg/CompressedImage"),
    topic("/b/imu", "sensor_msgs/msg/Imu"),
    topic("/b/cmd_vel", "geometry_msgs/msg/Twist", 0),
  ]);
  expect(layout.maps).toEqual([{ odom: "/b/odom", scan: "/b/scan" }]);
  expect(layout.cameras).toEqual([{ name: "/b/camera", picture: "/b/camera/image/compressed", video: null }]);
  expect(layout.imus).toHaveLength(1);
  expect(layout.trees.map((one) => one.topic)).toEqual(["/a/scan", "/b/imu", "/b/odom", "/b/scan"]);
  expect(layout.drivable).toBe(true);
});

test("a camera's pictures and its video are one card; what differs in name is another camera", () => {
  const layout = layoutOf([
    topic("/b/front/image_raw", "sensor_msgs/msg/Image"),
    topic("/b/front/image/compressed", "sensor_msgs/msg/CompressedImage"),
    topic("/b/front/video", "foxglove_msgs/msg/CompressedVideo"),
    topic("/b/rear/h264", "foxglove_msgs/msg/CompressedVideo"),
    topic("/b/idle/video", "foxglove_msgs/msg/CompressedVideo", 0),
  ]);
  expect(layout.cameras).toEqual([
    { name: "/b/front", picture: "/b/front/image_raw", video: null },
    { name: "/b/front", picture: "/b/front/image/compressed", video: "/b/front/video" },
    { name: "/b/rear", picture: null, video: "/b/rear/h264" },
  ].sort((a, b) => a.name.localeCompare(b.name) || (a.picture ?? "").localeCompare(b.picture ?? "")));
  expect(layout.trees).toEqual([]);
});

test("what a camera published once yields to what it publishes now", () => {
  const pictures = (publishers: number) => ({ ...topic("/b/front/image/compressed", "sensor_msgs/msg/CompressedImage", publishers), messages: 9 });
  const video = (publishers: number) => ({ ...topic("/b/front/video", "foxglove_msgs/msg/CompressedVideo", publishers), messages: 9 });
  const shown = (a: number, b: number) => layoutOf([pictures(a), video(b)]).cameras.map(({ picture, video }) => [picture !== null, video !== null]);
  expect(shown(1, 0)).toEqual([[true, false]]);
  expect(shown(0, 1)).toEqual([[false, true]]);
  expect(shown(0, 0)).toEqual([[true, true]]);
});

test("a robot gets the plots that it has series for", () => {
  expect(plotsOf(new Set(["host.cpu.percent", "x.y"])).map((plot) => plot.title)).toEqual(["CPU"]);
  expect(plotsOf(new Set())).toEqual([]);
});

test("a timeline moves its window, ignores what is late and shows a silence as a hole", () => {
  const line = new Timeline(60);
  line.add(1000, 1);
  line.add(2000, 2);
  line.add(1500, 9);
  expect(line.values).toEqual([1, 2]);
  line.add(32_000, 3);
  expect(line.values).toEqual([1, 2, null, 3]);
  line.add(90_000, 4);
  expect(line.times[0]).toBeGreaterThanOrEqual(30);
});

test("history goes before the live values that came first", () => {
  const line = new Timeline(600);
  line.add(5000, 5);
  line.prepend([1000, 2000, 5000, 6000], [1, 2, 50, 60]);
  expect(line.values).toEqual([1, 2, 5]);
});

test("history is broken where something is known to be lost, however short", () => {
  const line = new Timeline(600);
  line.prepend([1000, 2000, 3000], [1, 2, 3], [{ from_ms: 2100, to_ms: 2900 }]);
  expect(line.values).toEqual([1, 2, null, 3]);
});

test("a message as rows: nesting, stamps, long arrays, big integers", () => {
  const rows = treeRows({
    header: { stamp: { sec: 3, nanosec: 40 }, frame_id: "base" },
    ranges: new Float32Array(360),
    count: 12n,
    points: [{ x: 1 }, { x: 2 }],
  });
  const text = rows.map(({ depth, name, value }) => `${" ".repeat(depth)}${name}=${value}`);
  expect(text).toEqual([
    "header=",
    " stamp=3.000000040 s",
    " frame_id=base",
    "ranges=[0, 0, 0, 0, 0, 0, … 360]",
    "count=12",
    "points=2 items",
    " 0=",
    "  x=1",
    " 1=",
    "  x=2",
  ]);
});

test("rows are bounded", () => {
  const wide = Object.fromEntries(Array.from({ length: 1000 }, (_, i) => [`f${i}`, i]));
  expect(treeRows(wide)).toHaveLength(MAX_ROWS);
});
