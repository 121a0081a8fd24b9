import { expect, test } from "vitest";
import { inspect } from "./h264";

const unit = (...bytes: number[]) => [0, 0, 0, 1, ...bytes];
const of = (...units: number[][]) => inspect(new Uint8Array(units.flat()));
const SPS = unit(0x67, 0x42, 0xc0, 0x1f, 0xd9);
const PPS = unit(0x68, 0xce);
const KEY = unit(0x65, 1, 2, 3);
const DELTA = unit(0x41, 1, 2, 3);

test("a key frame brings the parameters that its decoder is made by", () => {
  expect(of(SPS, PPS, KEY)).toEqual({ key: true, codec: "avc1.42c01f", parameters: "6742c01fd900" });
  expect(of(PPS, KEY)).toEqual({ key: true, codec: null, parameters: "" });
});

test("what builds on another frame is no key, also after other units", () => {
  expect(of(DELTA).key).toBe(false);
  expect(of(unit(0x09, 0xf0), unit(0x06, 5), DELTA).key).toBe(false);
});

test("short start codes are start codes; the first slice decides", () => {
  expect(inspect(new Uint8Array([0, 0, 1, 0x65, 9])).key).toBe(true);
  expect(of(DELTA, KEY).key).toBe(false);
});

test("what is no H.264 is no key and no harm", () => {
  for (const bytes of [[], [0, 0, 1], [0xff, 0xd8, 0xff], [0, 0, 1, 0x67], [0, 0, 1, 0x67, 1, 2]]) {
    expect(inspect(new Uint8Array(bytes))).toEqual({ key: false, codec: null, parameters: "" });
  }
});

test("parameters of absurd length are cut", () => {
  expect(of(unit(0x67, 1, 2, 3, ...Array<number>(5000).fill(7)), KEY).parameters).toHaveLength(512);
});
