import { expect, test } from "vitest";
import type { Document, Rule } from "../api/rules";
import type { JsonObject } from "../values/json";
import { documentOf, faultAt, lineOf, NEW, read, textOf, withPlace, withSource } from "./document";
import { fieldsOf, fieldText, fieldValue, newTarget, TARGETS } from "./target_fields";
import { inText, inZone, lanesOf } from "./times";
import { filterWords, lets, sourceOf, sourceWords, targetWords, whenWords, worstFirst } from "./words";

const document = (changes: Partial<Document>): Document => ({ name: "x", ...changes });
const rule = (name: string, changes: Partial<Rule> = {}): Rule => ({
  name, description: "", enabled: true, pattern: null, until: null, topic: null, metric: null, schedule: null, when: null, event_format: "eventbridge", targets: [], revision: 1,
  changed: "", maker: { name: "ada", role: "admin", robots: ["*"] }, next_fire: null,
  stats: { matched: 0, fired: 0, errors: 0, last_fired: null, last_error: "", last_error_at: null, groups: 0 }, ...changes,
});

test("what a rule listens to is said in words", () => {
  expect(sourceWords(document({ pattern: { "detail-type": ["metaros.alert.opened", { prefix: "metaros.node." }] } }))).toBe("alert.opened or node.…");
  expect(sourceWords(document({ topic: { topic: "/scan", robots: ["sim_*", "arm_1"] } }))).toBe("/scan of sim_* or arm_1");
  expect(sourceWords(document({ metric: { series: "cpu", robots: ["*"], above: 90 } }))).toBe("cpu above 90");
  expect(sourceWords(document({ schedule: { expression: "rate(1 hour)", timezone: "Europe/Paris" } }))).toBe("rate(1 hour) in Europe/Paris");
  expect(sourceWords(document({ pattern: { source: ["metaros.webhook/lift"] } }))).toBe("anything from webhook/lift");
  expect(sourceWords(document({}))).toBe("nothing yet");
  expect(sourceOf(document({ topic: { topic: "/x" }, pattern: {} }))).toBe("topic");
});

test("what has to hold besides is said too", () => {
  const pattern: JsonObject = { "detail-type": ["x"], detail: { robot: [{ prefix: "sim_" }], value: [{ numeric: ["<", 0.2] }], state: [{ "anything-but": ["ok", "idle"] }], note: [{ exists: false }] } };
  expect(filterWords(document({ pattern }))).toEqual(["robot sim_…", "value < 0.2", "state not ok or idle", "note absent"]);
  expect(whenWords(document({ when: { cooldown: "10m", for: "30s", rate: { count: 3, within: "1m" }, edge: "falling" } }))).toEqual(["for 30s", "3 times within 1m", "when it ends", "then quiet for 10m"]);
  expect(whenWords(document({ when: { hysteresis: { enter: 0.2, exit: 0.3 }, debounce: { quiet: "2s", fires: "leading" } } }))).toEqual(["once quiet for 2s", "from 0.2 until 0.3"]);
});

test("every kind of target has its words and its fields", () => {
  for (const kind of Object.keys(TARGETS)) {
    const target = newTarget(kind, []);
    expect(targetWords(target), kind).not.toBe(kind);
    expect(fieldsOf(target).length, kind).toBeGreaterThan(0);
  }
  expect(targetWords({ kind: "webhook", url: "https://hooks.example/T0/secret" })).toBe("asks hooks.example");
  expect(targetWords({ kind: "command", command: "dock" })).toBe("sends dock to the robot");
  expect(targetWords({ kind: "aws", service: "sqs", queue_url: "q" })).toBe("hands it to AWS sqs q");
  expect(newTarget("alert", [{ id: "alert" }, { id: "alert_2" }]).id).toBe("alert_3");
});

test("a field's text becomes what the gateway wants", () => {
  expect(fieldValue("", undefined)).toBeUndefined();
  expect(fieldValue("60", "number")).toBe(60);
  expect(fieldValue("soon", "number")).toBe("soon");
  expect(fieldValue("/scan, /odom", "list")).toEqual(["/scan", "/odom"]);
  expect(fieldText(["/scan", "/odom"])).toBe("/scan /odom");
  expect(fieldText(undefined)).toBe("");
});

test("a document is what was written, without what the gateway adds and without what is usual", () => {
  const made = documentOf(rule("low", { metric: { series: "cpu", above: 90 } }));
  expect(made).toEqual({ name: "low", enabled: true, metric: { series: "cpu", above: 90 }, targets: [] });
  expect(read(textOf(made))).toEqual({ document: made, problem: "" });
  expect(read("[]").problem).toBe("A rule is a JSON object.");
  expect(read("{").problem).toContain("No JSON");
  expect(textOf(read('{"a": 10.0}').document!)).toContain("10.0");
});

test("one place of a document changes, the rest stays", () => {
  const before: JsonObject = { name: "x", targets: [{ id: "a" }, { id: "b" }] };
  expect(withPlace(before, ["targets", 1, "url"], "u")).toEqual({ name: "x", targets: [{ id: "a" }, { id: "b", url: "u" }] });
  expect(withPlace(before, ["targets", 0], undefined)).toEqual({ name: "x", targets: [{ id: "b" }] });
  expect(withPlace(before, ["when", "for"], "1s").when).toEqual({ for: "1s" });
  expect(withPlace({ name: "x" }, ["targets", 0], { id: "c" }).targets).toEqual([{ id: "c" }]);
  expect(before).toEqual({ name: "x", targets: [{ id: "a" }, { id: "b" }] });
});

test("a rule listens to one source, and a schedule waits for nothing", () => {
  const before: JsonObject = { name: "x", pattern: { a: [1] }, when: { for: "1s" }, targets: [] };
  expect(Object.keys(withSource(before, "topic"))).toEqual(["name", "topic", "when", "targets"]);
  expect(withSource(before, "schedule").when).toBeUndefined();
  expect(withSource(NEW, "metric").metric).toBeDefined();
});

test("a fault stands at its place", () => {
  const faults = [{ path: "targets[0].url", message: "an http(s) URL" }, { path: "when.for", message: "a time" }];
  expect(faultAt(faults, "targets[0].url")).toBe("an http(s) URL");
  expect(faultAt(faults, "when")).toBe("for: a time");
  expect(faultAt(faults, "targets[1]")).toBe("");
  expect(faultAt(faults, "target")).toBe("");
  const found: JsonObject = { name: "x", targets: [{ id: "a", url: "u" }] };
  expect(textOf(found).split("\n")[lineOf(found, "targets[0].url")]).toContain('"url": "u"');
  expect(lineOf(found, "nothing.there")).toBe(-1);
  expect(textOf(found).split("\n")[lineOf(found, "targets[0].kind")]).toContain("{");
});

test("those with trouble first, what is off last", () => {
  const stats = rule("x").stats;
  const rows = [rule("off", { enabled: false, stats: { ...stats, errors: 9 } }), rule("idle"), rule("busy", { stats: { ...stats, fired: 9 } }), rule("bad", { stats: { ...stats, errors: 1 } })];
  expect(worstFirst(rows).map(({ name }) => name)).toEqual(["bad", "busy", "idle", "off"]);
  expect(lets(rule("low", { targets: [{ kind: "function", function: "dock" }] }), "dock LOW")).toBe(true);
  expect(lets(rule("low"), "dock")).toBe(false);
});

test("times are told in their own zone", () => {
  expect(inZone("2026-11-23T02:00:00Z", "Europe/Berlin")).toMatch(/^Mon,? 23 Nov,? 03:00$/);
  expect(inZone("2026-11-23T02:00:00Z", "No/Where")).toMatch(/^Mon,? 23 Nov,? 02:00 UTC$/);
  expect(inText("2026-11-23T02:00:00Z", Date.parse("2026-11-23T01:56:00Z"))).toBe("in 4\u202fmin");
  expect(inText("2026-11-23T02:00:00Z", Date.parse("2026-11-23T02:00:01Z"))).toBe("now");
});

test("firings are in lanes by robot, and too many robots share one", () => {
  const firing = (robot: string, s: number) => ({ robot, at: new Date(s * 1000).toISOString() });
  const lanes = lanesOf([firing("b", 25), firing("a", 50), firing("a", 75)], 0, 100_000, 8);
  expect(lanes.map(({ name }) => name)).toEqual(["a", "b"]);
  expect(lanes[0]!.marks.map(({ at }) => at)).toEqual([0.5, 0.75]);
  const many = lanesOf(Array.from({ length: 10 }, (_, i) => firing(`r${i}`, i)), 0, 10_000, 4);
  expect(many.map(({ name }) => name)).toEqual(["r0", "r1", "r2", "7 more robots"]);
  expect(many[3]!.marks).toHaveLength(7);
});
