import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { FakeSocket } from "./fake_socket.test.support";
import { ACK_LIMIT_MS, IDLE_RELEASE_MS, Teleop } from "./teleop";

const FORWARD = { linear: 0.5, angular: 0 };
const GRANT = { op: "granted", lease_id: "L", expires_in_s: 1, topic: "/sim_1/cmd_vel" };

let socket: FakeSocket;
let teleop: Teleop;

beforeEach(() => {
  vi.useFakeTimers();
  teleop = new Teleop(() => (socket = new FakeSocket()), "me", () => Date.now());
});
afterEach(() => vi.useRealTimers());

function holdGranted(): void {
  teleop.hold(FORWARD);
  socket.open();
  socket.say(GRANT);
}

test("holding takes the lease, then drives at once and ten times a second", () => {
  teleop.hold(FORWARD);
  socket.open();
  expect(socket.sent).toEqual([{ op: "take", holder: "me" }]);
  socket.say(GRANT);
  expect(teleop.state.value).toBe("holding");
  expect(socket.sent[1]).toEqual({ op: "drive", linear: 0.5, angular: 0, seq: 1 });
  vi.advanceTimersByTime(400);
  expect(socket.ops().filter((op) => op === "drive")).toHaveLength(5);
});

test("letting go stops at once, and nothing is sent after", () => {
  holdGranted();
  teleop.letGo();
  expect(socket.ops().at(-1)).toBe("stop");
  vi.advanceTimersByTime(1000);
  expect(socket.ops().at(-1)).toBe("stop");
  expect(teleop.state.value).toBe("armed");
});

test("letting go before the grant never drives", () => {
  teleop.hold(FORWARD);
  teleop.letGo();
  socket.open();
  socket.say(GRANT);
  vi.advanceTimersByTime(500);
  expect(socket.ops()).toEqual(["take"]);
});

test("a second hold uses the lease that is still held", () => {
  holdGranted();
  const first = socket;
  teleop.letGo();
  teleop.hold(FORWARD);
  expect(socket).toBe(first);
  expect(socket.ops()).toEqual(["take", "drive", "stop", "drive"]);
});

test("after a while without a hold the lease is given back", () => {
  holdGranted();
  teleop.letGo();
  vi.advanceTimersByTime(IDLE_RELEASE_MS);
  expect(socket.ops().slice(-2)).toEqual(["stop", "release"]);
  expect(socket.closed).toBe(true);
  expect(teleop.state.value).toBe("idle");
});

test("silence while driving is a lost link: stop, and a new hold is needed", () => {
  holdGranted();
  vi.advanceTimersByTime(ACK_LIMIT_MS + 200);
  expect(teleop.state.value).toBe("lost");
  expect(socket.ops().at(-1)).toBe("stop");
  const count = socket.sent.length;
  vi.advanceTimersByTime(1000);
  expect(socket.sent).toHaveLength(count);
});

test("acknowledgements keep it going and show the round trip", () => {
  holdGranted();
  for (let i = 0; i < 20; i++) {
    vi.advanceTimersByTime(100);
    socket.say({ op: "ack", seq: i, rtt_ms: 2.5 });
  }
  expect(teleop.state.value).toBe("holding");
  expect(teleop.rttMs.value).toBe(2.5);
});

test("a closed socket ends the hold; aiming later does nothing", () => {
  holdGranted();
  socket.drop();
  expect(teleop.state.value).toBe("lost");
  teleop.aim(FORWARD);
  const count = socket.sent.length;
  vi.advanceTimersByTime(500);
  expect(socket.sent).toHaveLength(count);
});

test("a refusal names who drives", () => {
  teleop.hold(FORWARD);
  socket.open();
  socket.say({ op: "refused", code: "lease_taken", holder: "ann" });
  expect(teleop.state.value).toBe("refused");
  expect(teleop.detail.value).toBe("ann is driving");
});
