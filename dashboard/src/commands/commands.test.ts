import { expect, test } from "vitest";
import type { Command } from "../api/commands";
import { writeJson } from "../values/json";
import { blankForm, formOf, orderOf } from "./form";
import { stepsOf, tookText } from "./steps";
import { parseObject, titleOf, whyOf } from "./words";

const NOW = Date.parse("2026-11-21T12:00:00Z");
const at = (ms: number) => new Date(NOW + ms).toISOString();

function command(changes: Partial<Command> = {}): Command {
  return {
    id: "01A", robot: "sim_1", kind: "call_service", request: {}, state: "issued", durable: false, issued_by: "ada", idempotency_key: null,
    timeout_s: 10, issued: at(0), expires: null, delivered: null, running: null, ended: null, code: "", message: "", result: null, ...changes,
  };
}
const standings = (one: Command) => stepsOf(one).map(({ word, status }) => `${word} ${status}`);
const tooks = (one: Command) => stepsOf(one).map(({ took }) => took);

test("a durable command awaits one step after another", () => {
  const one = command({ durable: true });
  expect(standings(one)).toEqual(["issued there", "delivered next", "running ahead", "done ahead"]);
  const sent = { ...one, state: "delivered" as const, delivered: at(4) };
  expect(standings(sent)).toEqual(["issued there", "delivered there", "running next", "done ahead"]);
  const runs = { ...sent, state: "running" as const, running: at(1504) };
  expect(standings(runs)).toEqual(["issued there", "delivered there", "running there", "done next"]);
  expect(tooks(runs)).toEqual(["", "4\u202fms", "1.5\u202fs", ""]);
});

test("a step without a time that must have been is untold, one that never was is missed", () => {
  const done = command({ state: "done", delivered: at(0), ended: at(212) });
  expect(standings(done)).toEqual(["issued there", "delivered there", "running untold", "done there"]);
  expect(tooks(done)).toEqual(["", "0\u202fms", "", "212\u202fms"]);
  const refused = command({ state: "failed", delivered: at(1), ended: at(9) });
  expect(standings(refused)[2]).toBe("running untold");
  expect(standings({ ...refused, durable: true })[2]).toBe("running missed");
  const expired = command({ durable: true, state: "expired", ended: at(3_600_000) });
  expect(standings(expired)).toEqual(["issued there", "delivered missed", "running missed", "expired there"]);
  const skipped = command({ durable: true, state: "running", running: at(9) });
  expect(standings(skipped)).toEqual(["issued there", "delivered untold", "running there", "done next"]);
});

test.each([
  ["done", "good"],
  ["failed", "bad"],
  ["expired", "bad"],
  ["cancelled", "off"],
  ["running", null],
] as const)("%s ends %s", (state, end) => {
  expect(stepsOf(command({ state, ended: end && at(9) })).map((step) => step.end)).toEqual([null, null, null, end]);
});

test("spans are never negative: clocks are stepped", () => {
  expect([tookText(-5), tookText(999), tookText(1000), tookText(180_000)]).toEqual(["0\u202fms", "999\u202fms", "1\u202fs", "3\u202fmin"]);
});

test.each([
  ["publish", { topic: "/a/note" }, "Publish on /a/note"],
  ["call_service", { service: "/a/go", type: "T" }, "Call /a/go"],
  ["node_verb", { node: "lidar", verb: "restart" }, "Restart lidar"],
  ["node_verb", { node: "lidar", verb: "signal", signal: 10 }, "Send signal 10 to lidar"],
  ["read_log", { node: "lidar" }, "Read the log of lidar"],
  ["save_recording", { last_s: 300 }, "Save the last 5\u202fmin"],
  ["set_uplink", { bytes_per_s: 50_000 }, "Limit the uplink to 50.0\u202fkB/s"],
  ["set_uplink", { bytes_per_s: null }, "Lift the uplink's limit"],
  ["dance_now", null, "dance now"],
])("%s %j reads well", (kind, request, title) => {
  expect(titleOf({ kind, request })).toBe(title);
});

test("why something failed is the gateway's own sentence, else what the code means", () => {
  expect(whyOf({ code: "interrupted", message: "" })).toContain("agent was killed");
  expect(whyOf({ code: "nope", message: "nope" })).toBe("nope");
  expect(whyOf({ code: "constructor", message: "" })).toBe("constructor");
  expect(whyOf({ code: "timeout", message: "no answer in 5 s" })).toBe("no answer in 5 s");
});

test("a form makes its order, and an order its form again", () => {
  const call = { ...blankForm("call_service"), service: " /a/go ", serviceType: "std_srvs/srv/SetBool", request: '{"data": true}', timeoutS: "5" };
  expect(orderOf(call)).toEqual({ kind: "call_service", request: { service: "/a/go", type: "std_srvs/srv/SetBool", request: { data: true } }, durable: false, timeout_s: 5 });
  const later = { ...blankForm("node_verb"), node: "lidar", verb: "signal", durable: true, expiresS: 43_200 };
  expect(orderOf(later)).toEqual({ kind: "node_verb", request: { node: "lidar", verb: "signal", signal: 15 }, durable: true, expires_s: 43_200, timeout_s: 10 });
  const clip = { ...blankForm("save_recording"), topics: "/a/**, /b/scan", durable: true };
  expect(orderOf(clip)).toMatchObject({ request: { last_s: 60, topics: ["/a/**", "/b/scan"] }, durable: false });
  expect(orderOf({ ...blankForm("set_uplink"), limit: "12.5" }).request).toEqual({ bytes_per_s: 12_500 });
  expect(orderOf(blankForm("set_uplink")).request).toEqual({ bytes_per_s: null });
  for (const form of [call, later, clip, { ...blankForm("publish"), topic: "/a", type: "T", message: '{"x": [1]}' }]) {
    const order = orderOf(form);
    expect(orderOf({ ...formOf(command({ ...order }))!, expiresS: form.expiresS, timeoutS: form.timeoutS })).toEqual(order);
  }
});

test("what cannot be is said by its field", () => {
  expect(() => orderOf(blankForm("publish"))).toThrow("Give a topic.");
  expect(() => orderOf({ ...blankForm("call_service"), service: "/a" })).toThrow("Give a type.");
  expect(() => orderOf({ ...blankForm("set_uplink"), limit: "much" })).toThrow("kB/s");
  expect(() => orderOf({ ...blankForm("set_uplink"), timeoutS: "0" })).toThrow("time-out");
  expect(() => parseObject("{\n  bad}")).toThrow("line 2");
  expect(() => parseObject("[1]")).toThrow("object");
  expect(parseObject("  ")).toEqual({});
});

test("numbers of a message are sent as they were typed", () => {
  const order = orderOf({ ...blankForm("publish"), topic: "/a", message: '{"stamp": 1152921504606846977, "rate": 10.0}' });
  expect(writeJson(order.request)).toBe('{"topic":"/a","message":{"stamp":1152921504606846977,"rate":10.0}}');
  expect(formOf(command({ kind: "publish", request: order.request }))!.message).toContain("1152921504606846977");
});

test("bytes and unknown kinds are not asked again by the form", () => {
  expect(formOf(command({ kind: "publish", request: { topic: "/a", cdr: "AAAA" } }))).toBeNull();
  expect(formOf(command({ kind: "dance" }))).toBeNull();
});
