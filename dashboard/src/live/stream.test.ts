import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { FakeSocket } from "./fake_socket.test.support";
import { Stream } from "./stream";

let sockets: FakeSocket[];
let stream: Stream;

beforeEach(() => {
  vi.useFakeTimers();
  sockets = [];
  stream = new Stream(() => {
    const socket = new FakeSocket();
    sockets.push(socket);
    return socket;
  });
  stream.start();
});
afterEach(() => vi.useRealTimers());

test("subscriptions made before the connection are sent when it opens", () => {
  stream.topic({ robots: "sim_1", topics: "/sim_1/scan" }, () => {});
  expect(sockets[0]!.sent).toEqual([]);
  sockets[0]!.open();
  expect(sockets[0]!.sent).toEqual([{ op: "subscribe", id: 1, robots: "sim_1", topics: "/sim_1/scan" }]);
});

test("a lost connection is made again and everything still wanted is subscribed again", () => {
  const end = stream.topic({ robots: "a", topics: "/x" }, () => {});
  stream.metrics({ robots: "*", series: ["**"] }, () => {});
  sockets[0]!.open();
  end();
  sockets[0]!.drop();
  expect(stream.state.value).toBe("lost");
  vi.advanceTimersByTime(250);
  sockets[1]!.open();
  expect(stream.state.value).toBe("open");
  expect(sockets[1]!.ops()).toEqual(["subscribe_metrics"]);
});

test("waits between attempts grow to two seconds and start anew after a success", () => {
  const waits: number[] = [];
  for (let attempt = 0; attempt < 5; attempt++) {
    const before = sockets.length;
    sockets.at(-1)!.drop();
    let waited = 0;
    while (sockets.length === before) {
      vi.advanceTimersByTime(50);
      waited += 50;
    }
    waits.push(waited);
  }
  expect(waits).toEqual([250, 500, 1000, 2000, 2000]);
  sockets.at(-1)!.open();
  sockets.at(-1)!.drop();
  const before = sockets.length;
  vi.advanceTimersByTime(250);
  expect(sockets.length).toBe(before + 1);
});

test("metrics and fleet go to their own subscriber; the first fleet of a connection is complete", () => {
  const seen: unknown[] = [];
  stream.fleet((robots, complete) => seen.push([robots.length, complete]));
  stream.metrics({ robots: "*", series: [] }, (robot, stamp, values) => seen.push([robot, stamp, values]));
  sockets[0]!.open();
  sockets[0]!.say({ op: "fleet", id: 1, robots: [{}, {}] });
  sockets[0]!.say({ op: "fleet", id: 1, robots: [{}] });
  sockets[0]!.say({ op: "metrics", id: 2, robot: "a", stamp_ms: 5, values: { x: 1 } });
  sockets[0]!.say({ op: "metrics", id: 99, robot: "a", stamp_ms: 5, values: {} });
  expect(seen).toEqual([[2, true], [1, false], ["a", 5, { x: 1 }]]);
});

test("what cannot be read is counted and the stream goes on", () => {
  sockets[0]!.open();
  sockets[0]!.say(new ArrayBuffer(7));
  sockets[0]!.onmessage?.({ data: "not json" } as MessageEvent);
  sockets[0]!.say({ op: "dropped", id: 1, count: 3, total: 3 });
  expect(stream.dropped.value).toBe(5);
  expect(stream.state.value).toBe("open");
});

test("a stopped stream makes no connection before it is started, and then one", () => {
  stream.fleet(() => {});
  sockets[0]!.open();
  stream.stop();
  expect([sockets[0]!.closed, stream.state.value]).toEqual([true, "connecting"]);
  sockets[0]!.drop(); // its close event comes later
  vi.advanceTimersByTime(10_000);
  expect(sockets.length).toBe(1);
  stream.start();
  sockets[1]!.open();
  expect(sockets[1]!.ops()).toEqual(["subscribe_fleet"]);
  sockets[1]!.drop();
  stream.stop(); // while it waits to connect again
  stream.start();
  vi.advanceTimersByTime(10_000);
  expect(sockets.length).toBe(3);
});
