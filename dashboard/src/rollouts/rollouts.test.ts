import { expect, test } from "vitest";
import type { Bundle, Member, MemberState } from "../api/rollouts";
import { orderOf } from "./plan";
import { allowedOf, foundAmong, isReady, labelsOf, newestFirst, nodesOf, partsOf, partsText, robotsText, settled, thingOf, wavesOf, withTerm, worstFirst } from "./words";

const member = (robot: string, state: MemberState, reason = ""): Member => ({ robot, state, wave: 1, since: "2026-11-21T12:00:00Z", reason });
const bundle = (name: string, version: string, changes: Partial<Bundle> = {}): Bundle => ({
  path: `nodes/${name}/${version}.zip`, kind: "node", name, version, min_version: "", hw: [], python: "", sha256: "", size_bytes: 1,
  signed: true, uploaded: "", uploaded_by: "", withdrawn: null, reason: "", ...changes,
});

test("a wave's parts are all of it, and none is negative", () => {
  const wave = { wave: 1, size: 10, in_flight: 2, done: 3, failed: 1 };
  expect(partsOf(wave).map(({ count }) => count)).toEqual([3, 2, 1, 4]);
  expect(partsText(partsOf(wave))).toBe("3 done, 2 in flight, 1 failed, 4 waiting");
  expect(partsOf({ ...wave, size: 3 })[3]!.count).toBe(0);
  expect(partsText(partsOf({ wave: 1, size: 0, in_flight: 0, done: 0, failed: 0 }))).toBe("nobody");
});

test.each([
  [0.1, 1, 0],
  [0.1, 10, 1],
  [0.29, 100, 29],
  [1, 7, 7],
])("of a wave at %d of %d robots %d may fail", (rate, size, most) => {
  expect(allowedOf(rate, size)).toBe(most);
});

test("what is settled counts failed and left out ones", () => {
  const counts = { waiting: 2, starting: 1, updating: 1, done: 3, failed: 2, unreached: 1 };
  expect(settled({ counts, robots: 10 })).toBe(0.6);
  expect(settled({ counts, robots: 0 })).toBe(0);
});

test("robots that need somebody stand first, each state in its own order", () => {
  const list = [member("d", "done"), member("w", "waiting"), member("b", "failed"), member("u", "updating"), member("a", "failed")];
  expect(worstFirst(list).map(({ robot }) => robot).join("")).toBe("bauwd");
});

test("robots are found by state, name and reason", () => {
  const list = [member("bot_1", "failed", "Rolled back"), member("bot_2", "failed"), member("arm", "done")];
  expect(foundAmong(list, "failed", "").length).toBe(2);
  expect(foundAmong(list, "", "rolled").map(({ robot }) => robot)).toEqual(["bot_1"]);
  expect(foundAmong(list, "done", "bot")).toEqual([]);
});

test("versions are ordered as numbers", () => {
  const list = [bundle("b", "1.9.0"), bundle("a", "1.0.0"), bundle("b", "1.10.0")];
  expect(newestFirst(list).map(({ name, version }) => name + version)).toEqual(["a1.0.0", "b1.10.0", "b1.9.0"]);
  expect([bundle("a", "1"), bundle("a", "1", { signed: false }), bundle("a", "1", { withdrawn: "2026-11-21T12:00:00Z" })].map(isReady)).toEqual([true, false, false]);
});

test("a label is a term that can be put in and taken out", () => {
  expect(withTerm("", "site=lab")).toBe("site=lab");
  expect(withTerm("kind=arm,site=lab", "zone=1")).toBe("kind=arm, site=lab, zone=1");
  expect(withTerm("kind=arm, site=lab", "kind=arm")).toBe("site=lab");
  const robots: { labels: Record<string, string> }[] = [{ labels: { a: "1", b: "2" } }, { labels: { b: "2" } }, { labels: { c: "3" } }];
  expect(labelsOf(robots, 2)).toEqual([{ term: "b=2", robots: 2 }, { term: "a=1", robots: 1 }]);
});

test("an order is what was typed, with the agent's or a node's name", () => {
  const plan = { path: "", node: " ", selector: " site=lab ", waves: "2 10%;100%", failures: "5", healthS: "60", steadyS: "0", offlineS: "30" };
  const common = { version: "1.2.0", selector: "site=lab", waves: ["2", "10%", "100%"], max_failure_rate: 0.05, health_s: 60, steady_s: 0, offline_s: 30 };
  expect(orderOf(plan, bundle("lidar-node", "1.2.0"))).toEqual({ ...common, node: "lidar-node", bundle: "lidar-node" });
  expect(orderOf({ ...plan, node: "lidar" }, bundle("lidar-node", "1.2.0"))).toEqual({ ...common, node: "lidar", bundle: "lidar-node" });
  expect(orderOf({ ...plan, node: "lidar" }, bundle("metaros", "1.2.0", { kind: "agent" }))).toEqual({ ...common, node: "", bundle: "" });
});

test("nodes are found by their bundle", () => {
  const nodes = { lidar: { bundle: "lidar-node" }, camera: { bundle: "camera-node" }, own: { command: ["x"] }, odd: null };
  expect(nodesOf([{ document: { nodes } }, { document: { nodes: { back: { bundle: "lidar-node" } } } }, { document: {} }], "lidar-node")).toEqual(["back", "lidar"]);
});

test("names and counts read well", () => {
  expect(thingOf({ kind: "agent", node: "", version: "2.0.0" })).toBe("agent 2.0.0");
  expect(thingOf({ kind: "node", node: "lidar", version: "1.0" })).toBe("lidar 1.0");
  expect([robotsText(1), robotsText(1200)]).toEqual(["1 robot", "1,200 robots"]);
  expect(wavesOf("")).toEqual([]);
});
