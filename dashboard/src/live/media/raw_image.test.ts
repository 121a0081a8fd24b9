import { expect, test } from "vitest";
import { rawToRgba } from "./raw_image";

test("bgr with padded rows", () => {
  const data = new Uint8Array([1, 2, 3, 99, 4, 5, 6, 99]);
  expect([...rawToRgba({ width: 1, height: 2, step: 4, encoding: "bgr8", data })]).toEqual([3, 2, 1, 255, 6, 5, 4, 255]);
});

test("grey", () => {
  expect([...rawToRgba({ width: 2, height: 1, step: 2, encoding: "mono8", data: new Uint8Array([7, 8]) })]).toEqual([7, 7, 7, 255, 8, 8, 8, 255]);
});

test("a picture that is cut off or of another encoding is an error", () => {
  const data = new Uint8Array(2);
  expect(() => rawToRgba({ width: 2, height: 2, step: 6, encoding: "rgb8", data })).toThrow("cut off");
  expect(() => rawToRgba({ width: 1, height: 1, step: 2, encoding: "16UC1", data })).toThrow("16UC1");
});
