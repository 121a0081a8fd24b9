import { expect, test } from "vitest";
import { asPcm, mixed, packetOf } from "./sound";

const AUDIO = { timestamp: { sec: 2, nanosec: 5e8 }, format: "pcm-s16", sample_rate: 16000, number_of_channels: 1, data: new Uint8Array(4) };
const PACKET = { stamp: { sec: 1, nanosec: 0 }, codec: "opus", sample_rate: 48000, channels: 2, samples: 960, data: new Uint8Array(9) };

test("both messages are packets", () => {
  expect(packetOf(AUDIO)).toMatchObject({ codec: "pcm-s16", rate: 16000, channels: 1, stampMs: 2500 });
  expect(packetOf(PACKET)).toMatchObject({ codec: "opus", rate: 48000, channels: 2, stampMs: 1000 });
});

test.each([
  { ...AUDIO, format: "mp3" },
  { ...AUDIO, sample_rate: 0 },
  { ...AUDIO, sample_rate: 4294967295 },
  { ...AUDIO, sample_rate: "x" },
  { ...AUDIO, number_of_channels: 0 },
  { ...AUDIO, number_of_channels: 4294967295 },
  { ...AUDIO, data: new Uint8Array(3) },
  { ...AUDIO, data: new Uint8Array(1_000_000) },
  { ...AUDIO, data: "AAAA" },
  { ...PACKET, channels: 3 },
  { ...PACKET, data: new Uint8Array(0) },
  {},
])("what is absurd is said in words: %#", (message) => {
  expect(typeof packetOf(message)).toBe("string");
});

test("samples go there and back, and channels are mixed", () => {
  const samples = new Float32Array([0, 0.5, -0.5, -1, 2, -2]);
  const data = new Uint8Array(asPcm(samples));
  const back = mixed({ data, channels: 1 });
  expect([...back].map((value) => Math.round(value * 1000) / 1000)).toEqual([0, 0.5, -0.5, -1, 1, -1]);
  expect([...mixed({ data: data.slice(0, 8), channels: 2 })]).toEqual([0.25, -0.75]);
});
