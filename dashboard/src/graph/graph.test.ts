import { expect, test } from "vitest";
import type { Endpoint, RobotGraph } from "../api/introspect";
import { widthOf } from "./graph_svg";
import { curve, layout, type Arrow } from "./layout";
import { drawn, whyBroken } from "./model";

const end = (node: string, more: Partial<Endpoint> = {}): Endpoint => ({ node, type: "p/msg/T", type_hash: "", qos: "::,10:,:,:,,", ...more });
const GRAPH: RobotGraph = {
  robot: "r",
  revision: 1,
  nodes: ["/r/base", "/r/planner", "/r/idle"],
  topics: [
    { topic: "/r/odom", types: ["p/msg/T"], publishers: [end("/r/base")], subscribers: [end("/r/planner")] },
    { topic: "/r/cmd_vel", types: ["p/msg/T"], publishers: [end("/r/planner")], subscribers: [end("/r/base")] },
    { topic: "/r/goal", types: ["p/msg/T"], publishers: [], subscribers: [end("/r/planner")] },
    { topic: "/rosout", types: ["p/msg/T"], publishers: [end("/r/base"), end("")], subscribers: [] },
  ],
  services: [],
  actions: [], left_out: 0,
};
const box = (id: string) => ({ id, width: 80, height: 30 });

function overlaps(found: ReturnType<typeof layout>): string[] {
  const all = [...found.at.entries()];
  return all.flatMap(([a, one], i) => all.slice(i + 1).filter(([, other]) => Math.abs(one.x - other.x) < (one.width + other.width) / 2 && Math.abs(one.y - other.y) < (one.height + other.height) / 2).map(([b]) => `${a} on ${b}`));
}

test("arrows lead to the right, one closes the circle, and nothing lies on anything", () => {
  const arrows: Arrow[] = [{ from: "a", to: "b" }, { from: "b", to: "c" }, { from: "c", to: "a" }, { from: "a", to: "c" }, { from: "w", to: "d" }, { from: "d", to: "e" }, { from: "x", to: "e" }];
  const found = layout(["a", "b", "c", "w", "d", "e", "x"].map(box), arrows);
  const x = (id: string) => found.at.get(id)!.x;
  expect(x("a")).toBeLessThan(x("b"));
  expect(x("b")).toBeLessThan(x("c"));
  expect(x("x")).toBe(x("d")); // close to what it leads to
  expect(overlaps(found)).toEqual([]);
  const back = found.lines[2]!;
  expect(back[0]![0]).toBeGreaterThan(back.at(-1)![0]); // from c back to a
  expect(found.lines[3]).toHaveLength(3); // past the column of b
  expect(curve(found.lines[0]!)).toMatch(/^M[\d.]+ [\d.]+C/);
});

test("a large graph is placed quickly, within its bounds, without overlaps, and always alike", () => {
  let seed = 7;
  const random = (below: number) => (seed = (seed * 1103515245 + 12345) % 2147483648) % below;
  const names = Array.from({ length: 120 }, (_, i) => `v${i}`);
  const arrows = Array.from({ length: 240 }, () => ({ from: names[random(120)]!, to: names[random(120)]! })).filter(({ from, to }) => from !== to);
  const found = layout(names.map(box), arrows);
  expect(overlaps(found)).toEqual([]);
  for (const { x, y } of found.at.values()) {
    expect(x - 40).toBeGreaterThanOrEqual(-0.01);
    expect(x + 40).toBeLessThanOrEqual(found.width + 0.01);
    expect(y - 15).toBeGreaterThanOrEqual(-0.01);
    expect(y + 15).toBeLessThanOrEqual(found.height + 0.01);
  }
  expect(layout(names.map(box), arrows)).toEqual(found);
  expect(layout([], [])).toMatchObject({ width: 0, height: 0, lines: [] });
});

test("nodes and topics become vertices, plumbing is left out, an input that nobody feeds is no problem", () => {
  const all = drawn(GRAPH, { namespace: "/r", plumbing: false, wanted: "" });
  expect(all.vertices.map(({ label }) => label).sort()).toEqual(["base", "cmd_vel", "goal", "odom", "planner"]);
  expect([all.edges.length, all.alone]).toEqual([5, ["/r/idle"]]);
  expect([all.problems, all.waiting]).toEqual([[], ["/r/goal"]]);
  expect(drawn(GRAPH, { namespace: "/r", plumbing: true, wanted: "" }).vertices.map(({ label }) => label)).toContain("other nodes");
  expect(drawn(GRAPH, { namespace: "/r", plumbing: false, wanted: "ODOM" }).edges).toHaveLength(2);
});

test("what cannot get through says why", () => {
  const asks = end("/r/b", { qos: ":1:,10:,:,:,," });
  expect(whyBroken([end("/r/a", { qos: "2::,5:,:,:,," })], end("/r/b"))).toBe("best effort is offered, reliable is asked for");
  expect(whyBroken([end("/r/a")], asks)).toBe("volatile is offered, transient local is asked for");
  expect(whyBroken([end("/r/a"), asks], asks)).toBe(""); // one of them reaches it
  expect(whyBroken([end("/r/a", { type: "p/msg/U" })], end("/r/b"))).toBe("it is p/msg/U there");
  expect(whyBroken([end("/r/a", { type_hash: "1" })], end("/r/b", { type_hash: "2" }))).toContain("otherwise");
  expect(whyBroken([end("/r/a")], end("/r/b", { qos: "2::,5:,:,:,," }))).toBe("");
});

test("what does not get through is a problem, said once for each node that hears nothing", () => {
  const topic = { topic: "/r/scan", types: ["p/msg/T"], publishers: [end("/r/base", { qos: "2::,5:,:,:,," })], subscribers: [end("/r/map"), end("", { qos: "2::,5:,:,:,," })] };
  const { problems, waiting } = drawn({ ...GRAPH, topics: [topic] }, { namespace: "/r", plumbing: false, wanted: "" });
  expect(problems).toEqual([{ topic: "/r/scan", text: "/r/map hears nothing: best effort is offered, reliable is asked for" }]);
  expect(waiting).toEqual([]);
});

test("a line is as wide as its traffic, within bounds", () => {
  const widths = [0, 100, 10_000, 1e6, 1e12].map(widthOf);
  expect(widths).toEqual([...widths].sort((a, b) => a - b));
  expect([widths[0], widths.at(-1)]).toEqual([1.4, 7]);
});
