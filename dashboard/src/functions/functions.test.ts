import { expect, test } from "vitest";
import type { Canary, FunctionDetail, FunctionRow, LogLine } from "../api/functions";
import { highlighted } from "./highlight";
import { roundTop, slots } from "./series";
import { changeOf, formOf, readEnvironment, wrongLine } from "./settings";
import { behind, kindOf, MOST_LINES } from "./tail";
import { likely, TEMPLATES, templateText } from "./templates";
import { canaryText, errorShare, lets, milliseconds, sharesOf, topicOf, triggerWords, worstFirst } from "./words";

const T0 = Date.parse("2026-11-22T12:00:00Z");
const iso = (ms: number) => new Date(ms).toISOString();
const STATS: FunctionRow["stats"] = {
  window_s: 600, invocations: 0, errors: 0, throttles: 0, cold_starts: 0, running: 0, p50_ms: null, p95_ms: null, p99_ms: null, iterator_age_s: null, waiting: 0, dead_letters: 0, series: [],
};
const row = (name: string, changes: Partial<FunctionRow> = {}): FunctionRow => ({
  name, arn: "", description: "", runtime: "python3.11", interpreter: "python3.11.9", handler: "app.handler", state: "Active", reason: "", timeout_s: 3, memory_mb: 128, disk_mb: 512,
  code_sha256: "", code_bytes: 1, modified: iso(T0), versions: 0, aliases: [], triggers: [], concurrency: { reserved: null, warm: 0 }, stats: STATS, ...changes,
});
const detail: FunctionDetail = {
  ...row("dock"), environment: { LEAST: "0.2" }, layers: [], published: [], mappings: [],
  event_invoke: { most_retries: 2, most_age_s: 21600, on_success: "", on_failure: "", dead_letter: "" },
};
const minute = (agoMin: number, invocations: number, errors = 0, p95_ms: number | null = 4) => ({ at: iso(T0 - agoMin * 60_000), invocations, errors, throttles: 0, p95_ms });

test("minutes have their places in the window, and those out of it none", () => {
  const found = slots({ window_s: 600, series: [minute(11, 99), minute(9, 1), minute(0, 7, 2, 9)] }, T0 + 30_000);
  expect(found).toHaveLength(10);
  expect(found[0]!.invocations).toBe(1);
  expect(found.at(-1)).toMatchObject({ atMs: T0, invocations: 7, errors: 2, p95Ms: 9 });
  expect(found[4]).toMatchObject({ invocations: 0, p95Ms: null });
});

test("wider places add up, and the slowest minute stands for them", () => {
  const found = slots({ window_s: 600, series: [minute(1, 3, 1, 20), minute(0, 4, 0, 5), minute(2, 5, 0, null)] }, T0 + 60_000, 2);
  expect(found).toHaveLength(5);
  expect(found.reduce((sum, slot) => sum + slot.invocations, 0)).toBe(12);
  expect(Math.max(...found.map(({ p95Ms }) => p95Ms ?? 0))).toBe(20);
});

test("the top of a plot is a round number that holds the most", () => {
  expect([0, 1, 1.2, 13.7, 135, 4800].map(roundTop)).toEqual([1, 1, 1.5, 15, 150, 5000]);
});

test("durations and shares of errors are read at a glance", () => {
  expect([null, 0.115, 2.314, 83, 412.6, 3000].map(milliseconds)).toEqual(["–", "0.12\u202fms", "2.31\u202fms", "83\u202fms", "413\u202fms", "3\u202fs"]);
  expect(errorShare({ errors: 0, invocations: 9 })).toBe("");
  expect(errorShare({ errors: 1, invocations: 900 })).toBe("< 1\u202f%");
  expect(errorShare({ errors: 37, invocations: 204 })).toBe("18\u202f%");
});

test("a topic's ARN is a topic of robots in words, anything else as it is", () => {
  expect(topicOf("arn:aws:metaros:::topic/sim_*/camera/image")).toEqual({ robots: "sim_*", topic: "/camera/image" });
  expect(triggerWords({ kind: "mapping", title: "arn:aws:metaros:local:000000000000:topic/*/scan" })).toBe("/scan");
  expect(triggerWords({ kind: "mapping", title: "arn:aws:sqs:eu:1:q" })).toBe("arn:aws:sqs:eu:1:q");
  expect(triggerWords({ kind: "rule", title: "battery_low" })).toBe("battery_low");
});

test("those that need somebody come first", () => {
  const busy = row("busy", { stats: { ...STATS, invocations: 900 } });
  const failing = row("failing", { stats: { ...STATS, invocations: 9, errors: 2 } });
  const dead = row("dead", { stats: { ...STATS, dead_letters: 1 } });
  const broken = row("broken", { state: "Failed" });
  expect(worstFirst([row("idle"), busy, dead, failing, broken]).map(({ name }) => name)).toEqual(["broken", "failing", "dead", "busy", "idle"]);
  expect(lets(row("x", { triggers: [{ kind: "mapping", id: "1", title: "arn:aws:metaros:::topic/*/scan", enabled: true }] }), "SCAN x")).toBe(true);
  expect(lets(row("x"), "scan")).toBe(false);
});

test("a canary says how it does, and shares add up", () => {
  const canary: Canary = { version: "2", stable: "1", weight: 0.1, error_rate: 0.05, least_invocations: 20, for_s: 600, step: 0, state: "running", reason: "", began: "", changed: "", invocations: 40, errors: 3 };
  expect(canaryText(canary)).toBe("Version 2 gets 10\u202f%, version 1 the rest: 3 of 40 calls failed so far.");
  expect(canaryText({ ...canary, state: "rolled_back", reason: "3 of 40 calls failed" })).toBe("Version 1 gets every call again: 3 of 40 calls failed");
  expect(canaryText({ ...canary, state: "cancelled" })).toBe("Version 1 gets every call again.");
  expect(canaryText({ ...canary, state: "promoted" })).toContain("Version 2 gets every call");
  expect(sharesOf("1", { "2": 0.25 })).toEqual([["1", 0.75], ["2", 0.25]]);
  expect(sharesOf("1", {})).toEqual([["1", 1]]);
});

test("a log keeps its newest lines, each once", () => {
  const line = (cursor: number): LogLine => ({ cursor, at: iso(T0), request_id: "", version: "1", text: "" });
  const first = [line(1), line(2)];
  expect(behind(first, [line(2)])).toBe(first);
  expect(behind(first, [line(2), line(3)]).map(({ cursor }) => cursor)).toEqual([1, 2, 3]);
  expect(behind(first, Array.from({ length: MOST_LINES }, (_, i) => line(i + 3)))).toHaveLength(MOST_LINES);
});

test("the runtime's own lines and what went wrong are told apart", () => {
  expect(kindOf("START RequestId: 1 Version: 2")).toBe("mark");
  expect(kindOf("REPORT RequestId: 1 Duration: 2 ms")).toBe("report");
  expect(kindOf("KeyError: 'value'")).toBe("error");
  expect(kindOf("[ERROR] KeyError")).toBe("error");
  expect(kindOf("2026 Task timed out after 3.00 seconds")).toBe("error");
  expect(kindOf("[WARNING] low")).toBe("warn");
  expect(kindOf("no error here")).toBe("");
});

test("every example is an event as rules hand it over", () => {
  for (const name of Object.keys(TEMPLATES)) {
    const event = JSON.parse(templateText(name, "arm_1", new Date(T0))) as Record<string, unknown>;
    if (name !== "empty") expect(event).toMatchObject({ version: "0", source: expect.stringMatching(/^metaros/), time: "2026-11-22T12:00:00Z", region: "local" });
  }
  expect(templateText("battery", "arm_1", new Date(T0))).toContain('"robot": "arm_1"');
  const trigger = (kind: "rule" | "schedule" | "mapping", enabled = true) => ({ kind, id: "x", title: "x", enabled });
  expect(likely({ triggers: [trigger("mapping")] })).toBe("topic");
  expect(likely({ triggers: [trigger("schedule", false)] })).toBe("alert");
  expect(likely({ triggers: [] })).toBe("alert");
});

test("only what differs is sent", () => {
  const form = formOf(detail);
  expect(changeOf(detail, form)).toEqual({});
  expect(changeOf(detail, { ...form, timeout: "30", reserved: "4", retries: "0", onFailure: "arn:x", environment: "LEAST=0.3\n\nURL=http://x/?a=b" })).toEqual({ timeout_s: 30, reserved: 4, event_invoke: { most_retries: 0, on_failure: "arn:x" }, environment: { LEAST: "0.3", URL: "http://x/?a=b" } });
  const bounded = { ...detail, concurrency: { reserved: 4, warm: 0 } };
  expect(changeOf(bounded, { ...formOf(bounded), reserved: "" })).toEqual({ reserved: -1 });
  expect(wrongLine("A=1\n1B=2")).toBe("1B=2");
  expect(readEnvironment(" A = x ")).toEqual({ A: " x " });
});

test("colours change no character of the code", () => {
  const code = 'import os\n\n@log\ndef go(x=1.5):  # why\n    """doc\'s"""\n    return f"{x}" if x else None\n';
  const pieces = highlighted("a.py", code);
  expect(pieces.map(([, text]) => text).join("")).toBe(code);
  const of = (token: string) => pieces.filter(([one]) => one === token).map(([, text]) => text);
  expect(of("word")).toEqual(["import", "def", "return", "if", "else", "None"]);
  expect(of("name")).toEqual(["@log", "go"]);
  expect(of("comment")).toEqual(["# why"]);
  expect(of("string")).toEqual(['"""doc\'s"""', 'f"{x}"']);
  expect(highlighted("a.bin", "x = 1")).toEqual([["", "x = 1"]]);
});
