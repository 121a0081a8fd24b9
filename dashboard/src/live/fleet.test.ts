import { beforeEach, expect, test } from "vitest";
import type { Robot } from "../api/types";
import { FakeSocket } from "./fake_socket.test.support";
import { concerns, cpuSpark, followFleet, health, latest, robots, setValue, SPARK_POINTS, worstFirst } from "./fleet";
import { Stream } from "./stream";

const robot = (id: string, state: "online" | "offline" = "online") =>
  ({ id, state, link: { rtt_ms: 1, outbox_bytes: 0, bytes_per_s: 0, classes: [], forks: 0 }, latest: {}, alerts: { open: 0, error: 0, warning: 0 } }) as unknown as Robot;

beforeEach(() => {
  robots.value = null;
});

test("the first list is the fleet, later lists change it", () => {
  const socket = new FakeSocket();
  const stream = new Stream(() => socket);
  stream.start();
  followFleet(stream);
  socket.open();
  socket.say({ op: "fleet", id: 1, robots: [robot("a"), robot("b")] });
  socket.say({ op: "fleet", id: 1, robots: [robot("b", "offline")] });
  expect(robots.value!.map(({ id, state }) => [id, state])).toEqual([["a", "online"], ["b", "offline"]]);
  socket.say({ op: "metrics", id: 2, robot: "a", stamp_ms: 10, values: { "battery_state.percentage": 0.5, x: null } });
  expect(latest("a", "battery_state.percentage").value).toEqual({ stamp_ms: 10, value: 0.5 });
});

test("worst first, numbers in numeric order", () => {
  setValue("low", "battery_state.percentage", { stamp_ms: 1000, value: 0.1 });
  const order = worstFirst([robot("r10"), robot("r2"), robot("low"), robot("gone", "offline")], 1000);
  expect(order.map(({ id }) => id)).toEqual(["gone", "low", "r2", "r10"]);
  expect(health(robot("low"), 1000)).toBe("attention");
  expect(concerns(robot("low"), 1000)).toEqual(["battery low"]);
});

test("a copied outbox wants a person's eyes", () => {
  const copied = robot("copied");
  copied.link.forks = 1;
  expect(concerns(copied, 1000)).toEqual(["outbox copied"]);
});

test("an old value is no concern of now", () => {
  setValue("old", "battery_state.percentage", { stamp_ms: 1000, value: 0.1 });
  expect(concerns(robot("old"), 60_000)).toEqual([]);
});

test("an older value never replaces a newer one; the spark line is bounded", () => {
  setValue("s", "host.cpu.percent", { stamp_ms: 50, value: 1 });
  setValue("s", "host.cpu.percent", { stamp_ms: 40, value: 2 });
  expect(latest("s", "host.cpu.percent").value!.value).toBe(1);
  for (let i = 0; i < 100; i++) setValue("s", "host.cpu.percent", { stamp_ms: 100 + i, value: i });
  expect(cpuSpark("s").value).toHaveLength(SPARK_POINTS);
});
