import { expect, test } from "vitest";
import type { StoredMessage } from "../api/history_types";
import { FrameError } from "../live/records";
import { Timeline } from "../panels/plots/timeline";
import { parseSnapshot, recordOf } from "./snapshot_frame";
import { Latest } from "./latest";
import { Past, type Asks } from "./past";
import { frameAround, msOf, parseMoment, ticksOf, windowAround, windowFor, xOf } from "./span";
import { trailOf } from "./path";

/** An answer of one record, as the gateway packs it. */
function answer(head: object, payload: number[] = [], stampMs = 1000): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(head));
  const size = payload.length > 0 ? 40 + Math.ceil(payload.length / 8) * 8 : 0;
  const body = new Uint8Array(4 + text.length + size);
  const view = new DataView(body.buffer);
  view.setUint32(0, text.length, true);
  body.set(text, 4);
  if (size > 0) {
    const at = 4 + text.length;
    view.setUint32(at, size, true);
    view.setUint32(at + 8, 1, true);
    view.setUint32(at + 12, payload.length, true);
    view.setBigInt64(at + 24, BigInt(stampMs) * 1_000_000n, true);
    body.set(payload, at + 40);
  }
  return body.buffer;
}

const channel = { channel: 1, topic: "/a/scan" };
const head = (more: object = {}) => ({ t_ms: 1000, channels: [channel], missing: [], gaps: [], ...more });
const turn = () => new Promise((done) => setTimeout(done));

test("an answer of head and records, whatever the length of the head", () => {
  for (const pad of ["", "x", "xx", "xxx", "xxxxxxx"]) {
    const found = parseSnapshot(answer(head({ pad }), [7, 8, 9]));
    expect([...found.records.get("/a/scan")!.payload]).toEqual([7, 8, 9]);
    expect(found.records.get("/a/scan")!.stampMs).toBe(1000);
  }
});

test("an answer that is cut off is an error, never a part", () => {
  const whole = answer(head(), [1, 2, 3]);
  for (const size of [0, 3, 10, whole.byteLength - 1]) expect(() => parseSnapshot(whole.slice(0, size))).toThrow(FrameError);
});

test("a stored message as a record", () => {
  const record = recordOf({ seq: 4, stamp_ms: 5, cdr: btoa("\x00\x01\xff") } as StoredMessage, 9);
  expect([record.channel, record.seq, record.stampMs, ...record.payload]).toEqual([9, 4, 5, 0, 1, 255]);
});

test("of questions that overtake each other only the newest answer stays", async () => {
  const seen: number[] = [];
  const latest = new Latest<number>((value) => seen.push(value), () => {});
  const done: ((value: number) => void)[] = [];
  for (let i = 0; i < 5; i++) latest.ask(() => new Promise((resolve) => done.push(resolve)));
  expect(done).toHaveLength(2);
  done[1]!(1);
  await turn();
  expect(done).toHaveLength(3); // the newest that waited, not those between
  done[0]!(0);
  done[2]!(4);
  await turn();
  expect(seen).toEqual([1, 4]);
});

test("nothing comes after closing, and an error of an old question is nobody's business", async () => {
  const seen: unknown[] = [];
  const latest = new Latest<number>((value) => seen.push(value), (error) => seen.push(String(error)));
  const done: { resolve: (value: number) => void; reject: (error: unknown) => void }[] = [];
  const ask = () => latest.ask(() => new Promise((resolve, reject) => done.push({ resolve, reject })));
  ask();
  ask();
  done[0]!.reject("old");
  await turn();
  expect(seen).toEqual([]);
  done[1]!.reject("new");
  await turn();
  ask();
  latest.close();
  done[2]!.resolve(1);
  await turn();
  expect(seen).toEqual(["new"]);
});

test("the past: all watched topics in one request, records in the order of their stamps", async () => {
  const asked: string[][] = [];
  const asks: Asks = {
    at: async (_robot, _t, topics) => {
      asked.push(topics);
      return answer(head({ missing: [{ topic: "/a/b", reason: "not_stored", nearest_ms: null }] }), [2], 1000);
    },
    messages: async () => [1200, 900, 1000].map((stamp_ms) => ({ topic: "/a/scan", stamp_ms, seq: stamp_ms, cdr: btoa("x") })),
  };
  const past = new Past("a", asks);
  const seen: unknown[] = [];
  past.watch({ topic: "/a/scan", backS: 1, aheadS: 1, onInstant: (t, missing) => seen.push([t, missing]), onRecord: (_, { stampMs }) => seen.push(stampMs) });
  past.watch({ topic: "/a/b", backS: 0, aheadS: 0, onInstant: (_, missing) => seen.push(missing?.reason), onRecord: () => seen.push("never") });
  past.seek(1000);
  await turn();
  expect(asked).toEqual([["/a/scan", "/a/b"]]);
  expect(seen).toEqual([[1000, null], 900, 1000, 1200, "not_stored"]);
});

test("the past: a loss over the instant is the reason, and what came before it is shown all the same", async () => {
  const loss = { from_ms: 1500, to_ms: 9000, count: 3, reason: "outbox_full", topic: "/a/scan" };
  const past = new Past("a", { at: async () => answer(head({ gaps: [loss] }), [2], 1000), messages: async () => [] });
  const seen: unknown[] = [];
  past.watch({ topic: "/a/scan", backS: 0, aheadS: 0, onInstant: (_, missing) => seen.push(missing), onRecord: (_, { stampMs }) => seen.push(stampMs) });
  past.seek(5000);
  await turn();
  expect(seen).toEqual([{ topic: "/a/scan", reason: "outbox_full", nearest_ms: 1000 }, 1000]);
});

test("a window ends now while the instant is in it, and stays while it is dragged in", () => {
  expect(windowAround(null, 100, 1000)).toEqual({ startMs: 900, endMs: 1000 });
  expect(windowAround(950, 100, 1000)).toEqual({ startMs: 900, endMs: 1000 });
  const far = windowAround(500, 100, 1000);
  expect(far).toEqual({ startMs: 450, endMs: 550 });
  expect(windowFor(far, 549, 100, 2000)).toBe(far);
  expect(windowFor(far, 600, 100, 2000)).toEqual({ startMs: 550, endMs: 650 });
  expect(windowFor(far, 500, 40, 2000)).toEqual({ startMs: 480, endMs: 520 });
});

test("pixels and instants", () => {
  const window = { startMs: 1000, endMs: 2000 };
  expect([xOf(window, 200, 1500), msOf(window, 200, 50), msOf(window, 200, 900)]).toEqual([100, 1250, 2000]);
});

test("ticks are round and not too near to each other", () => {
  const hour = { startMs: 1_700_000_123_000, endMs: 1_700_003_723_000 };
  const ticks = ticksOf(hour, 1200);
  expect(ticks.every((tick) => tick % 300_000 === 0)).toBe(true);
  expect(ticks).toHaveLength(12);
});

test("plots end at the present, and otherwise have the instant in their middle", () => {
  expect(frameAround(1000, 100, 5000)).toEqual({ startMs: 950, endMs: 1050 });
  expect(frameAround(4990, 100, 5000)).toEqual({ startMs: 4900, endMs: 5000 });
});

test("a path breaks where nothing came for long and where the robot was put elsewhere", () => {
  const column = (axis: string, mean: number[]) => ({ name: `odom.pose.pose.position.${axis}`, stamp_ms: [0, 500, 60_000, 60_500], mean, min: [], max: [], count: [] });
  const trail = trailOf({ series: [column("x", [0, 1, 2, 9]), column("y", [0, 0, 0, 0])] });
  expect(trail).toEqual([0, 0, 1, 0, NaN, NaN, 2, 0, NaN, NaN, 9, 0]);
  expect(trailOf({ series: [] })).toEqual([]);
});

test("a line is cut where something is lost, and a value holds only for a while", () => {
  const line = new Timeline(Infinity, 10);
  line.add(1000, 1);
  line.cut();
  line.add(2000, 2);
  expect(line.values).toEqual([1, null, 2]);
  expect([line.valueAt(0.5), line.valueAt(1.00005), line.valueAt(1.5), line.valueAt(3), line.valueAt(99)]).toEqual([null, 1, null, 2, null]);
});

test("what is no time is LIVE", () => {
  expect([parseMoment(null), parseMoment("yesterday"), parseMoment("2026-11-21T06:00:00Z")]).toEqual([null, null, 1795240800000]);
});
