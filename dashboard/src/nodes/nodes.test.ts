import { expect, test } from "vitest";
import type { LogPage, Node, NodeReport, NodeRow } from "../api/nodes";
import { begunWith, MOST_CHARS, MOST_LINES, olderFrom, withNewer, withOlder } from "./log_lines";
import { cut, levelOf, programOf, reasonsOf, resultWords, toneOf, verbsOf } from "./node_words";

const row = (changes: Partial<NodeRow> = {}): NodeRow => ({ bundle: "", version: "", allowed: "lidar", command: [], restart: "always", critical: false, nice: 0, migratable: false, run: true, ...changes });
const report = (changes: Partial<NodeReport> = {}): NodeReport => ({ state: "running", why: "", pid: 7, restarts: 0, since: null, last_exit: "", version: "", waits_for: [], lease_id: "", nice: 0, quarantined: false, crashes: 0, safe_stop: "", update: null, ...changes });
const node = (changes: Partial<Node> = {}): Node => ({ robot: "r1", name: "lidar", ros_name: "/r1/lidar", online: true, state: "running", wanted: "running", in_step: true, differs: [], in_own: true, desired: row(), reported: report(), reported_at: null, holder: null, ...changes });

test.each([
  ["runs", node(), ["stop", "restart"]],
  ["runs, the robot is away", node({ online: false }), ["stop"]],
  ["is stopped as desired", node({ state: "stopped", wanted: "stopped", desired: row({ run: false }) }), ["start"]],
  ["was stopped by hand on the robot", node({ state: "stopped", reported: report({ state: "stopped", why: "by hand" }) }), ["start"]],
  ["has ended", node({ state: "ended" }), ["start", "retry"]],
  ["is quarantined", node({ state: "quarantined" }), ["stop", "retry"]],
  ["waits for its lease", node({ state: "stopped", reported: report({ state: "stopped", why: "no lease" }) }), ["stop"]],
  ["stands by", node({ state: "stopped", wanted: "standby" }), ["stop"]],
  ["is not in the twin", node({ desired: null, wanted: "absent", state: "stopped" }), []],
])("a node that %s has its buttons", (_, one, verbs) => {
  expect(verbsOf(one)).toEqual(verbs);
});

test("a state has a tone, and what a robot said before it went is no more than that", () => {
  expect(toneOf(node())).toBe("good");
  expect(toneOf(node({ online: false }))).toBe("off");
  expect(toneOf(node({ state: "quarantined" }))).toBe("bad");
  expect(toneOf(node({ state: "stopped", in_step: false }))).toBe("warn");
  expect(toneOf(node({ state: "stopped", wanted: "stopped" }))).toBe("off");
  expect(toneOf(node({ state: "of a later version" }))).toBe("warn");
});

test("reasons are said once, updates where nothing else speaks of them", () => {
  const update = { state: "rolled_back", version: "2.0", code: "", message: "3 exits" };
  const version = { what: "version", desired: "2.0", reported: "1.0", why: "2.0 was rolled back" };
  expect(reasonsOf(node({ differs: [version, version], reported: report({ update }) }))).toEqual(["2.0 was rolled back"]);
  expect(reasonsOf(node({ reported: report({ update }) }))).toEqual(["version 2.0: rolled back, 3 exits"]);
  expect(reasonsOf(node({ state: "stopped", wanted: "stopped", reported: report({ why: "not to run" }) }))).toEqual([]);
  expect(reasonsOf(node({ reported: report({ safe_stop: "failed" }) }))).toEqual(["safe stop of the robot: failed"]);
  expect(reasonsOf(node({ state: "ended", reported: report({ last_exit: "exit code 0" }) }))).toEqual(["exit code 0"]);
});

test("what a node runs, and what became of a verb", () => {
  expect(programOf(node({ desired: row({ bundle: "lidar-node", version: "1.2", allowed: "" }) }))).toBe("lidar-node 1.2");
  expect(programOf(node({ desired: row({ allowed: "", command: ["a", "-b"] }) }))).toBe("a -b");
  expect(programOf(node({ desired: null }))).toBe("not in the twin");
  const result = { node: "lidar", verb: "stop" as const, told: false, message: "the robot is offline" };
  expect(resultWords({ ...result, outcome: "done" })).toBe("lidar was stopped.");
  expect(resultWords({ ...result, outcome: "pending" })).toContain("stops lidar when it is back");
});

test("a search is marked where it is found, whatever the case, and nothing is lost", () => {
  expect(cut("No device, NO Device", "no d")).toEqual(["", "No d", "evice, ", "NO D", "evice"]);
  expect(cut("İ no", "no").join("")).toBe("İ no");
  expect(cut("text", "")).toEqual(["text"]);
});

test.each([["[ERROR] [x]: y", "error"], ["Traceback (most recent call last):", "error"], ["[WARN] z", "warn"], ["no ERRORS", ""], ["fine", ""]])("%s is %s", (text, level) => {
  expect(levelOf(text)).toBe(level);
});

const lines = (...texts: string[]) => texts.map((text) => ({ at: null, at_ns: text, text }));
const texts = ({ lines: all }: { lines: { text: string }[] }) => all.map(({ text }) => text).join("");
const page = (cursor: string, more: boolean, ...said: string[]): LogPage => ({ cursor, more, lines: lines(...said) });

test("older pages come before, without a line twice, while new ones come after", () => {
  let log = begunWith(page("50", false, "c", "d"));
  expect([olderFrom(log), log.older]).toEqual(["50", true]);
  log = withNewer(log, page("60", false, "e"));
  log = withOlder(log, page("20", true, "b", "c", "d")); // read backwards from 50: holds the newest page
  expect(texts(log)).toBe("bcde");
  expect(log.base).toBe(-1); // "c" is number 0 still
  expect([olderFrom(log), log.end]).toEqual(["20", "60"]);
  log = withOlder(log, page("0", false, "a"));
  expect([texts(log), log.older, log.base]).toEqual(["abcde", false, -2]);
});

test("a log is bounded: the oldest lines go, and can be asked for no more", () => {
  const many = Array.from({ length: MOST_LINES }, (_, i) => `${i} `);
  const log = withNewer(begunWith(page("1", false, "x ", "y ")), page("2", false, ...many));
  expect([log.lines.length, log.lines[0]!.text, log.base, log.older, log.first.count]).toEqual([MOST_LINES, "0 ", 2, false, 0]);
  const long = withNewer(log, page("3", false, "z".repeat(MOST_CHARS + 1)));
  expect(long.lines).toHaveLength(1); // one line stays, however long
  expect(withOlder({ ...long, begin: "1" }, page("0", true, "a")).older).toBe(false);
});
