import { expect, test } from "vitest";
import { DevicesModel, isTrouble, MAX_DEVICES } from "./devices_model";

const driver = (name: string, state: string, values: Record<string, string | number> = {}, level = 0) => ({
  level,
  name,
  message: state,
  hardware_id: "sn 7",
  values: Object.entries({ kind: "ld19", state, rate_hz: "10", ...values }).map(([key, value]) => ({ key, value: String(value) })),
});
const told = (...status: object[]) => ({ header: {}, status });

function model(...messages: object[]): DevicesModel {
  const made = new DevicesModel();
  messages.forEach((message, i) => made.add(message, i * 1000));
  return made;
}

test("a driver says its state and rate itself; what else it says are values", () => {
  const [row] = model(told(driver("/r/ld19", "working", { firmware: "1.2" }))).rows(0, 5000);
  expect(row).toMatchObject({ name: "/r/ld19", kind: "ld19", state: "working", rateHz: 10, hardwareId: "sn 7" });
  expect(row!.values).toEqual([{ key: "firmware", text: "1.2", rising: false }]);
});

test("the worst is first, then by name", () => {
  const rows = model(told(driver("/b", "working"), driver("/c", "waiting", {}, 2), driver("/a", "working"), driver("/d", "working", {}, 1))).rows(0, 5000);
  expect(rows.map(({ name, state }) => [name, state])).toEqual([["/c", "waiting"], ["/d", "warning"], ["/a", "working"], ["/b", "working"]]);
});

test("of a foreign node the level is the state, and its values stay as they are", () => {
  const foreign = (level: number, name: string) => ({ level, name, message: "", hardware_id: "", values: [{ key: "state", value: "up" }] });
  const rows = model(told(foreign(0, "a"), foreign(1, "b"), foreign(2, "c"), foreign(3, "d"), foreign(9, "e"))).rows(0, 5000);
  expect(rows.map(({ name, state }) => `${name} ${state}`)).toEqual(["c error", "e error", "d stale", "b warning", "a ok"]);
  expect(rows[0]).toMatchObject({ kind: "", rateHz: null, rates: [], values: [{ key: "state", text: "up" }] });
});

test("who says nothing for long is silent, and is heard again", () => {
  const devices = model(told(driver("/a", "working")));
  expect(devices.rows(5000, 5000)[0]!.state).toBe("working");
  expect(devices.rows(5001, 5000)[0]!.state).toBe("silent");
  devices.add(told(driver("/a", "working")), 6000);
  expect(devices.rows(6001, 5000)[0]!.state).toBe("working");
});

test("a count that rose is marked for a while; texts and falls are not", () => {
  const counts = (bad: number, text = "x") => told(driver("/a", "working", { bad_checksum: bad, text }));
  const devices = model(counts(1), counts(3, "y"));
  const rising = () => devices.rows(0, 1e9)[0]!.values.filter((value) => value.rising).map(({ key }) => key);
  expect(rising()).toEqual(["bad_checksum"]);
  devices.add(counts(3), 9000);
  expect(rising()).toEqual(["bad_checksum"]);
  devices.add(counts(0), 11_500);
  expect(rising()).toEqual([]);
  expect(isTrouble("bad_checksum")).toBe(true);
  expect(isTrouble("readings")).toBe(false);
});

test("devices, values and texts are bounded, and what is left out is counted", () => {
  const many = Array.from({ length: MAX_DEVICES + 7 }, (_, i) => driver(`/d${i}`, "working"));
  const devices = model(told(...many), told(...many));
  expect(devices.rows(0, 5000)).toHaveLength(MAX_DEVICES);
  expect(devices.refused.size).toBe(7);
  const values = Object.fromEntries(Array.from({ length: 500 }, (_, i) => [`k${i}`, "x".repeat(1000)]));
  const [row] = model(told(driver("/a", "working", values))).rows(0, 5000);
  expect(row!.values.length).toBeLessThan(100);
  expect(row!.values[0]!.text.length).toBeLessThan(300);
});

test("rates are kept for the line; what is no number is none", () => {
  const devices = new DevicesModel();
  for (let i = 0; i < 100; i++) devices.add(told(driver("/a", "working", { rate_hz: i })), i);
  const [row] = devices.rows(0, 1e9);
  expect(row!.rates).toHaveLength(40);
  expect(row!.rates.at(-1)).toBe(99);
  expect(model(told(driver("/a", "working", { rate_hz: "fast" }))).rows(0, 5000)[0]!.rateHz).toBeNull();
});
