import { expect, test } from "vitest";
import type { Twin } from "../api/twin";
import { Exact, readJson, writeJson, type JsonObject } from "../values/json";
import { compare } from "./compare";
import { given, patchBetween, put, rebased, undone, unfolded, type Change } from "./document";
import { sectionsOf } from "./schema";
import { left, syncStatusOf, trialOf } from "./sync_status";

const json = (text: string) => readJson(text) as JsonObject;

test("a value is put without touching the old document, and an emptied section goes", () => {
  const before = json('{"topics":{"scan":{"class":"live"}},"nodes":{"lidar":{"allowed":"l"}}}');
  expect(put(before, ["topics", "scan"], undefined)).toEqual(json('{"nodes":{"lidar":{"allowed":"l"}}}'));
  expect(put(before, ["nodes", "lidar"], undefined)).toHaveProperty("nodes"); // {} is "run none"
  expect(before).toHaveProperty("topics.scan");
});

test("names that every object of JavaScript has are names like others", () => {
  const none = json('{"nodes":{}}');
  expect(put(none, ["nodes", "constructor", "nice"], 5)).toEqual(json('{"nodes":{"constructor":{"nice":5}}}'));
  expect(writeJson(put(none, ["nodes", "__proto__"], json('{"nice":1}')))).toBe('{"nodes":{"__proto__":{"nice":1}}}');
  expect(writeJson(patchBetween(json("{}"), json('{"__proto__":1,"toString":2}')))).toBe('{"__proto__":1,"toString":2}');
});

test("what templates say is what is desired and not one's own", () => {
  const desired = json('{"topics":{"scan":{"class":"live","rate_hz":5.0}},"lifecycle":{"/a":"active","/b":"active"}}');
  expect(given(desired, json('{"topics":{"scan":{"rate_hz":5.0}},"lifecycle":{"/b":"active"}}'))).toEqual(json('{"topics":{"scan":{"class":"live"}},"lifecycle":{"/a":"active"}}'));
  expect(given(desired, desired)).toEqual({});
});

test("a patch says only what differs; a draft is carried over to what somebody else made meanwhile", () => {
  const base = json('{"budget":{"bytes_per_s":1},"topics":{"a":{"rate_hz":1.0},"b":{}}}');
  const draft = json('{"topics":{"a":{"rate_hz":2.0},"b":{}}}');
  expect(writeJson(patchBetween(base, draft))).toBe('{"budget":null,"topics":{"a":{"rate_hz":2.0}}}');
  const newest = json('{"budget":{"bytes_per_s":1},"topics":{"a":{"rate_hz":1.0,"class":"live"}}}');
  expect(writeJson(rebased(base, draft, newest))).toBe('{"topics":{"a":{"rate_hz":2.0,"class":"live"}}}');
});

const CHANGES: Change[] = [
  { path: "/nodes/lidar/nice", verb: "change", old: 0, new: 5 },
  { path: "/topics/camera~1**", verb: "add", new: json('{"class":"live","rate_hz":5.0}') },
  { path: "/budget", verb: "remove", old: json('{"bytes_per_s":9}') },
];

test("changes are undone, and shown value by value", () => {
  const after = json('{"nodes":{"lidar":{"nice":5}},"topics":{"camera/**":{"class":"live","rate_hz":5.0}}}');
  expect(undone(after, CHANGES)).toEqual(json('{"nodes":{"lidar":{"nice":0}},"budget":{"bytes_per_s":9}}'));
  expect(CHANGES.flatMap(unfolded).map(({ path }) => path)).toEqual(["/nodes/lidar/nice", "/topics/camera~1**/class", "/topics/camera~1**/rate_hz", "/budget/bytes_per_s"]);
});

const twin = (changes: Partial<Twin>): Twin => ({
  robot: "arm_1", revision: 3, edition: 4, in_step: false, own: {}, desired: {}, templates: [], labels: {}, own_labels: {}, problem: "",
  author: "ada", at: "2026-11-21T12:00:00Z", reason: "", confirm_within_s: new Exact("60.0"), reported: null, behind: [], ...changes,
});
const reported = (state: "applied" | "applying" | "confirming" | "reverted" | "refused", revision: number, applied: number, values: JsonObject = {}) =>
  ({ at: "", revision, applied, state, code: "c", message: "why", values });

test.each([
  [twin({ revision: 0 }), true, "none"],
  [twin({ in_step: true, reported: reported("applied", 3, 3) }), false, "in_step"],
  [twin({ reported: reported("applied", 2, 2) }), true, "sending"],
  [twin({ reported: reported("applied", 2, 2) }), false, "waiting"],
  [twin({ reported: reported("applying", 3, 3) }), true, "applying"],
  [twin({ reported: reported("confirming", 3, 3) }), true, "confirming"],
  [twin({ reported: reported("reverted", 3, 2) }), true, "reverted"],
  [twin({ reported: reported("refused", 3, 2) }), true, "refused"],
  [twin({}), true, "sending"],
])("standing %#", (one, online, step) => {
  expect(syncStatusOf(one, online).step).toBe(step);
});

test("a trial that ended badly says by what the robot lives", () => {
  expect(syncStatusOf(twin({ reported: reported("reverted", 3, 2) }), true).text).toContain("It lives by revision 2 again");
  expect(syncStatusOf(twin({ reported: reported("refused", 3, 0) }), true).text).toContain("It lives by its own settings");
});

test("a trial is counted from when it was seen to begin, or asked for", () => {
  const asked = Date.parse("2026-11-21T12:00:00Z");
  const one = twin({ reported: reported("applying", 3, 3) });
  const first = trialOf(null, one, "applying", asked + 20_000, true)!;
  expect(left(first, 60, asked + 20_000)).toEqual({ s: 40, part: 40 / 60 });
  const watched = trialOf(null, one, "applying", asked + 20_000, false)!;
  expect(left(watched, 60, asked + 20_000).s).toBe(60);
  expect(trialOf(watched, one, "confirming", asked + 25_000, false)).toBe(watched);
  expect(trialOf(watched, one, "in_step", asked + 26_000, false)).toBe(null);
  expect(left(first, 60, asked + 90_000)).toEqual({ s: 0, part: 0 });
});

test("desired stands beside what the robot says is so", () => {
  const desired = json('{"nodes":{"lidar":{"version":"2.0","run":true}},"parameters":{"lidar":{"rate_hz":10.0,"frame":"a"}},"topics":{"scan":{"rate_hz":5.0}}}');
  const values = json('{"nodes":{"lidar":{"version":"1.0","state":"quarantined","last_exit":"exit code 1","update":{"message":"downloading"}}},"parameters":{"/arm_1/lidar":{"values":{"rate_hz":10,"frame":"b"},"refused":{"frame":"read only"}}}}');
  const rows = compare(twin({ desired, own: { topics: json('{"scan":{"rate_hz":5.0}}') }, in_step: true, reported: reported("applied", 3, 3, values) }), "/arm_1");
  const marks = Object.fromEntries(rows.map(({ section, key, mark, why }) => [`${section}.${key}`, [mark, why]]));
  expect(marks).toEqual({
    "topics.rate_hz": ["same", ""],
    "nodes.version": ["change", "downloading"],
    "nodes.run": ["change", "exit code 1"],
    "parameters.rate_hz": ["same", ""], // by two programs: 10 and 10.0
    "parameters.frame": ["change", "read only"],
  });
  expect(rows.filter(({ own }) => own)).toHaveLength(1);
});

test("what the robot does not have yet, and has still", () => {
  const desired = json('{"topics":{"camera/**":{"class":"live","rate_hz":5.0}},"nodes":{"lidar":{"nice":5}}}');
  const rows = compare(twin({ desired, behind: CHANGES, reported: reported("refused", 3, 2) }), "/");
  expect(rows.map(({ section, key, mark }) => [section, key, mark])).toEqual([
    ["topics", "class", "add"],
    ["topics", "rate_hz", "add"],
    ["nodes", "nice", "change"],
    ["budget", "bytes_per_s", "remove"],
  ]);
});

test("the schema becomes fields", () => {
  const sections = sectionsOf(json(`{"properties": {
    "budget": {"description": "b", "properties": {"bytes_per_s": {"anyOf": [{"const": 0}, {"type": "integer", "minimum": 1000, "maximum": 2000}]}}},
    "lifecycle": {"propertyNames": {"pattern": "^x$", "maxLength": 9}, "additionalProperties": {"enum": ["active", "inactive"]}},
    "parameters": {"additionalProperties": {"type": "object"}},
    "topics": {"additionalProperties": {"type": "object", "properties": {"rate_hz": {"default": 0.0, "type": "number", "minimum": 0, "maximum": 9}, "fields": {"type": "array", "items": {"type": "string", "maxLength": 3}}}}}
  }}`));
  expect(sections.map(({ section, name, row }) => [section, name, row?.type ?? null])).toEqual([
    ["budget", null, null],
    ["lifecycle", { pattern: "^x$", most: 9 }, "choice"],
    ["parameters", { pattern: "", most: 256 }, "parameters"],
    ["topics", { pattern: "", most: 256 }, null],
  ]);
  expect(sections[0]!.keys![0]!.field).toEqual({ type: "value", kind: "integer", limits: { range: { from: 1000, to: 2000, step: 0 }, zero: true } });
  expect(sections[3]!.keys!.map(({ key, field }) => [key, field.type === "value" && field.kind])).toEqual([["rate_hz", "double"], ["fields", "string_array"]]);
});
