import { describe, expect, test } from "vitest";
import { CloudReader } from "./cloud";

const BUDGET = { points: 100_000, ms: 1e9 };
const header = { frame_id: "lidar" };

/** n points of x = index, y = 2 × index, z = 0.5, intensity = index, in `step` bytes each. */
function points(n: number, { step = 22, big = false, height = 1, pad = 0 } = {}) {
  const width = n / height;
  const data = new Uint8Array(height * (width * step + pad));
  const view = new DataView(data.buffer);
  for (let index = 0; index < n; index++) {
    const at = Math.floor(index / width) * (width * step + pad) + (index % width) * step;
    view.setFloat32(at, index, !big);
    view.setFloat32(at + 4, 2 * index, !big);
    view.setFloat32(at + 8, 0.5, !big);
    view.setUint16(at + 12, index, !big);
  }
  const fields = ["x", "y", "z"].map((name, index) => ({ name, offset: 4 * index, datatype: 7, count: 1 }));
  fields.push({ name: "intensity", offset: 12, datatype: 4, count: 1 });
  return { header, height, width, fields, is_bigendian: big, point_step: step, row_step: width * step + pad, data, is_dense: true };
}

function quantized(grid: number[], intensities: number[], step = 0.5) {
  const bytes = new Uint8Array(new Uint16Array(grid).buffer);
  const data = new Uint8Array(bytes.length + intensities.length);
  data.set(bytes);
  data.set(intensities, bytes.length);
  return { header, count: grid.length / 3, origin: new Float64Array([1, 2, 3]), step_m: step, has_intensity: intensities.length > 0, data };
}

const read = (message: object, budget = BUDGET) => new CloudReader(budget).read(message as Record<string, unknown>);

test("points of any step, byte order and padding", () => {
  for (const options of [{}, { step: 16 }, { big: true }, { height: 2, pad: 5 }]) {
    const cloud = read(points(4, options));
    expect([...cloud.positions]).toEqual([0, 0, 0.5, 1, 2, 0.5, 2, 4, 0.5, 3, 6, 0.5]);
    expect([...cloud.intensities!]).toEqual([0, 1, 2, 3]);
    expect(cloud.frame).toBe("lidar");
  }
});

test("a quantised cloud is origin and steps", () => {
  const cloud = read(quantized([0, 1, 2, 65535, 0, 0], [7, 255]));
  expect([...cloud.positions]).toEqual([1, 2.5, 4, 32768.5, 2, 3]);
  expect([...cloud.intensities!]).toEqual([7, 255]);
  expect(read(quantized([1, 1, 1], [])).intensities).toBeNull();
});

test("points that are no numbers are left out", () => {
  const message = points(3);
  new DataView(message.data.buffer).setFloat32(22 + 4, NaN, true);
  new DataView(message.data.buffer).setFloat32(44, Infinity, true);
  const cloud = read(message);
  expect([...cloud.positions]).toEqual([0, 0, 0.5]);
  expect(cloud.total).toBe(3);
});

test("empty clouds", () => {
  expect(read(points(0)).positions).toHaveLength(0);
  expect(read(quantized([], [])).total).toBe(0);
  expect(read({ ...points(0), height: 0 }).height).toEqual([0, 1]);
});

test("more points than there is room for are decimated evenly, and said", () => {
  const cloud = read(points(10_000), { points: 3000, ms: 1e9 });
  expect(cloud.total).toBe(10_000);
  expect(cloud.positions.length / 3).toBe(2500);
  expect(cloud.positions[3]).toBe(4);
});

test("what takes too long has fewer points the next time, and more again when it goes fast", () => {
  let now = 0;
  let perRead = 100;
  const reader = new CloudReader({ points: 100_000, ms: 10 }, () => (now += perRead / 2));
  const drawn = () => reader.read(points(40_000) as unknown as Record<string, unknown>).positions.length / 3;
  expect(drawn()).toBe(40_000);
  expect(drawn()).toBeLessThan(9000); // 40 000 took 50 ms, 10 ms are allowed
  perRead = 2;
  for (let again = 0; again < 6; again++) drawn();
  expect(drawn()).toBe(40_000);
});

test("where most points are, without the few far ones", () => {
  const message = points(1000);
  new DataView(message.data.buffer).setFloat32(8, 900, true);
  expect(read(message).height).toEqual([0.5, 1.5]);
});

describe("absurd messages are an error", () => {
  const fine = points(4);
  const field = fine.fields[0]!;
  test.each([
    ["no coordinates", { fields: [] }, "no x"],
    ["a field behind the point", { fields: [{ ...field, offset: 20 }] }, "does not fit"],
    ["an offset of 4 GiB", { fields: [{ ...field, offset: 4294967295 }] }, "does not fit"],
    ["a type that there is not", { fields: [{ ...field, datatype: 200 }] }, "does not fit"],
    ["type 0", { fields: [{ ...field, datatype: 0 }] }, "does not fit"],
    ["points of no bytes", { point_step: 0 }, "of 0 bytes"],
    ["points of 4 GiB", { point_step: 4294967295 }, "points of 4294967295"],
    ["thousands of fields", { fields: Array(3000).fill(field) }, "3000 fields"],
    ["more points than bytes", { width: 4294967295 }, "cut off"],
    ["more rows than bytes", { height: 4294967295, row_step: 88 }, "cut off"],
    ["rows that are too short", { height: 2, width: 2, row_step: 1 }, "too short"],
    ["an intensity outside", { fields: [...fine.fields.slice(0, 3), { ...field, name: "intensity", offset: 22 }] }, "does not fit"],
  ])("%s", (_, change, words) => {
    expect(() => read({ ...fine, ...change })).toThrow(words);
  });
  test.each([
    ["more points than bytes", { count: 4294967295 }, "cut off"],
    ["no step", { step_m: 0 }, "step 0"],
    ["a step that is no number", { step_m: NaN }, "step NaN"],
  ])("quantised: %s", (_, change, words) => {
    expect(() => read({ ...quantized([1, 2, 3], [4]), ...change })).toThrow(words);
  });
});
