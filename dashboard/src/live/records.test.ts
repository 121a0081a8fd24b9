import { expect, test } from "vitest";
import { FrameError, HEADER_BYTES, parseFrame } from "./records";

function record(subscription: number, channel: number, seq: number, payload: number[]): number[] {
  const size = HEADER_BYTES + Math.ceil(payload.length / 8) * 8;
  const bytes = new Uint8Array(size);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, size, true);
  view.setUint32(4, subscription, true);
  view.setUint32(8, channel, true);
  view.setUint32(12, payload.length, true);
  view.setBigUint64(16, BigInt(seq), true);
  view.setBigInt64(24, 1_700_000_000_123_456_789n, true);
  view.setBigInt64(32, 1_700_000_000_125_000_000n, true);
  bytes.set(payload, HEADER_BYTES);
  return [...bytes];
}

const frame = (...records: number[][]) => new Uint8Array(records.flat()).buffer;

test("a frame of two records", () => {
  const [first, second] = parseFrame(frame(record(1, 7, 41, [0, 1, 0, 0, 9]), record(2, 8, 42, [])));
  expect(first).toMatchObject({ subscription: 1, channel: 7, seq: 41 });
  expect([...first!.payload]).toEqual([0, 1, 0, 0, 9]);
  expect(first!.stampMs).toBeCloseTo(1_700_000_000_123.456, 2);
  expect(first!.receiveMs - first!.stampMs).toBeCloseTo(1.544, 2);
  expect(second).toMatchObject({ subscription: 2, channel: 8, seq: 42 });
  expect(second!.payload.length).toBe(0);
});

test("an empty frame holds nothing", () => {
  expect(parseFrame(new ArrayBuffer(0))).toEqual([]);
});

test("every cut of a record is an error, never a wrong record", () => {
  const whole = frame(record(1, 7, 41, [1, 2, 3, 4, 5, 6, 7, 8]));
  for (let size = 1; size < whole.byteLength; size++) {
    expect(() => parseFrame(whole.slice(0, size))).toThrow(FrameError);
  }
});

test("a payload larger than its record is an error", () => {
  const bytes = record(1, 7, 41, [1]);
  bytes[12] = 200;
  expect(() => parseFrame(frame(bytes))).toThrow(FrameError);
});

test("a record of no size is an error, not an endless loop", () => {
  expect(() => parseFrame(new ArrayBuffer(HEADER_BYTES))).toThrow(FrameError);
});
