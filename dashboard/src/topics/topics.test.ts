import { expect, test } from "vitest";
import type { FieldShape, TypeShape } from "../api/introspect";
import type { Topic } from "../api/types";
import { writeJson } from "../values/json";
import { parsed } from "../values/values";
import { foxgloveUrl, viewerUrl } from "./foxglove";
import { asJson, MAX_ROWS, messageRows } from "./message_rows";
import { qosOf } from "./qos";
import { POINTS, Rates, topOf } from "./rates";
import { blankMessage, fieldOf, isSmall, lengthProblem, placed, typeText } from "./shape";

const field = (name: string, type: string, more: Partial<FieldShape> = {}): FieldShape => ({ name, type, array: "", capacity: 0, string_bound: 0, default: null, ...more });
const SHAPE: TypeShape = {
  type: "shop/msg/Lamps",
  type_hash: "",
  text: "",
  parts: { message: "shop/msg/Lamps" },
  definitions: {
    "shop/msg/Lamps": { constants: [], fields: [field("level", "float32"), field("lamps", "shop/msg/Lamp", { array: "fixed", capacity: 2 }), field("more", "shop/msg/Lamp", { array: "unbounded" })] },
    "shop/msg/Lamp": { constants: [], fields: [field("on", "bool"), field("name", "string", { string_bound: 8, default: "x" }), field("id", "uint64")] },
  },
};

test("a blank message has every field at its default, and numbers of their kind", () => {
  const lamp = '{"on":false,"name":"x","id":0}';
  expect(writeJson(blankMessage(SHAPE, "shop/msg/Lamps"))).toBe(`{"level":0.0,"lamps":[${lamp},${lamp}],"more":[]}`);
});

test("a value is placed without touching what was there", () => {
  const message = blankMessage(SHAPE, "shop/msg/Lamps");
  const next = placed(message, ["lamps", 1, "on"], true);
  expect(writeJson(next)).toContain('{"on":false,"name":"x","id":0},{"on":true');
  expect(writeJson(message)).not.toContain("true");
});

test("fields take what their type takes", () => {
  const take = (one: FieldShape, text: string) => {
    const spec = fieldOf(one);
    if (spec.type !== "value") throw new Error("no value");
    return parsed(spec.kind, text, spec.limits);
  };
  expect(take(field("a", "int8"), "-128")).toEqual({ value: -128 });
  expect(take(field("a", "int8"), "128")).toHaveProperty("problem");
  expect(take(field("a", "string", { string_bound: 2 }), "abc")).toHaveProperty("problem");
  expect(take(field("a", "bool", { array: "unbounded" }), "true, false")).toEqual({ value: [true, false] });
  expect(String((take(field("a", "uint64"), "18446744073709551615") as { value: unknown }).value)).toBe("18446744073709551615");
  expect([typeText(field("a", "float64", { array: "fixed", capacity: 9 })), typeText(field("a", "x/msg/Y", { array: "bounded", capacity: 3 }))]).toEqual(["float64[9]", "Y[<=3]"]);
  expect([lengthProblem(field("a", "bool", { array: "fixed", capacity: 2 }), 1), lengthProblem(field("a", "bool", { array: "bounded", capacity: 2 }), 2)]).toEqual(["1 of 2 values", ""]);
  expect([isSmall(SHAPE, "shop/msg/Lamp"), isSmall(SHAPE, "shop/msg/Lamps")]).toEqual([false, false]); // a text needs room
});

test("a message's rows keep their paths, open and close, and are bounded", () => {
  const message = { header: { stamp: { sec: 3, nanosec: 5 }, frame_id: "base" }, ranges: new Float32Array(360), names: ["a"], big: 2n ** 60n };
  const rows = messageRows(message, new Set());
  expect(rows.map(({ path, value, open }) => [path, value, open])).toEqual([
    ["header", "", true],
    ["header.stamp", "3.000000005 s", null],
    ["header.frame_id", "base", null],
    ["ranges", "[0, 0, 0, 0, 0, 0, 0, 0, …] 360 items", false],
    ["names", "[a]", null],
    ["big", "1152921504606846976", null],
  ]);
  const turned = messageRows(message, new Set(["header", "ranges"]));
  expect(turned[0]).toMatchObject({ open: false });
  expect(turned.at(-3)).toMatchObject({ path: "ranges.…", value: "160 more" });
  const deep = Array.from({ length: 3 }, () => ({ a: Array.from({ length: 4 }, () => ({ b: new Float64Array(100) })) }));
  const all = new Set(messageRows({ deep }, new Set()).filter(({ open }) => open === false).map(({ path }) => path));
  expect(messageRows({ deep }, all).length).toBeLessThanOrEqual(MAX_ROWS + 1);
  expect(asJson(message)).toContain('"big": 1152921504606846976');
  expect(JSON.parse(asJson({ ...message, odd: NaN }))).toMatchObject({ names: ["a"], odd: null, header: { frame_id: "base" } });
});

test("quality of service in words", () => {
  expect(qosOf("2::,5:,:,:,,")?.short).toBe("best effort · keep last 5");
  expect(qosOf(":1:,1:,:,:,,")?.short).toBe("reliable · transient local · keep last 1");
  expect(qosOf("::2,:0,500000000:,:3,2,")?.rows).toEqual([["reliability", "reliable"], ["durability", "volatile"], ["history", "keep all"], ["deadline", "0.5\u202fs"], ["lease", "2\u202fs"], ["liveliness", "manual by topic"]]);
  expect([qosOf(""), qosOf("reliable")]).toEqual([null, null]);
});

test("rates are kept for a while, of topics that there are", () => {
  const rates = new Rates();
  const topic = { topic: "/a", type: "t", rate_hz: 4 } as Topic;
  for (let i = 0; i < POINTS + 5; i += 1) rates.add([topic]);
  expect(rates.of(topic)).toHaveLength(POINTS);
  rates.add([]);
  expect(rates.of(topic)).toEqual([]);
  expect([topOf([9.8]), topOf([10]), topOf([0])]).toEqual([20, 20, 2e-9]);
});

test("the address for viewers carries robot and ticket, escaped once each", () => {
  const address = viewerUrl("arm 1/x", "mrt_a+b", { protocol: "https:", host: "fleet.example:8443" });
  expect(address).toBe("wss://fleet.example:8443/foxglove/arm%201%2Fx?token=mrt_a%2Bb");
  expect(viewerUrl("r", "", { protocol: "http:", host: "h" })).toBe("ws://h/foxglove/r");
  const query = new URL(foxgloveUrl(address)).searchParams;
  expect([query.get("ds"), query.get("ds.url")]).toEqual(["foxglove-websocket", address]);
});
