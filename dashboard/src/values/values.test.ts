import { expect, test } from "vitest";
import { Exact, readJson, same, writeJson, type JsonObject } from "./json";
import { kindOf, parsed } from "./values";

const json = (text: string) => readJson(text) as JsonObject;

test.each(['{"a":10.0,"b":[1,2.50,1e3],"c":{"d":null,"e":"10.0"},"f":1152921504606846976}', "[]", '{"__proto__":{"x":-0.0}}', '"a\\"{,"', '{"":[true,false,{}]}'])(
  "%s is written as it was read",
  (text) => expect(writeJson(readJson(text))).toBe(text),
);

test("an indented document reads back as the same, and lists of values stay on a line", () => {
  const document = json('{"a":{"b":[1.0,2],"c":{}},"d":[{"e":1}]}');
  const text = writeJson(document, 2);
  expect(text).toContain('"b": [1.0, 2]');
  expect(same(readJson(text), document)).toBe(true);
});

test("10 and 10.0 are two values, the order of keys is nothing", () => {
  expect(same(readJson("10"), readJson("10.0"))).toBe(false);
  expect(same(readJson('{"a":1,"b":2.0}'), readJson('{"b":2.0,"a":1}'))).toBe(true);
});

test("a text that is no JSON is refused with a place", () => {
  expect(() => readJson('{"a": 01}')).toThrow(/JSON|position|number/i);
});

test.each([
  ["integer", "7", { range: { from: 0, to: 10, step: 0 } }, 7],
  ["integer", "9007199254740993", {}, new Exact("9007199254740993")],
  ["double", "10", {}, new Exact("10.0")],
  ["double", ".5", {}, 0.5],
  ["double", "2.5", { range: { from: 0, to: 3, step: 0.5 } }, 2.5],
  ["bool_array", "true, false", {}, [true, false]],
  ["integer_array", "1 2,3", {}, [1, 2, 3]],
  ["string_array", "a b\n\nc\n", {}, ["a b", "", "c"]],
  ["byte_array", "0, 255", {}, [0, 255]],
] as const)("%s takes %s", (kind, text, limits, value) => {
  expect(parsed(kind, text, limits)).toEqual({ value });
});

test.each([
  ["integer", "7.5", {}, "without a point"],
  ["integer", "11", { range: { from: 0, to: 10, step: 0 } }, "0 to 10"],
  ["integer", "5", { range: { from: 1000, to: 2000, step: 0 }, zero: true }, "0, or 1000 to 2000"],
  ["integer", "5", { range: { from: 0, to: 10, step: 2 } }, "steps of 2"],
  ["double", "nan", {}, "a number"],
  ["string", "", { least: 1 }, "must not be empty"],
  ["string", "a b", { pattern: "^(?:[a-z]+)$" }, "does not take"],
  ["double_array", "1, x", {}, "item 2: a number"],
  ["byte_array", "256", {}, "item 1: 0 to 255"],
] as const)("%s does not take %s", (kind, text, limits, said) => {
  const found = parsed(kind, text, limits);
  expect("problem" in found && found.problem).toContain(said);
});

test.each([["true", "bool"], ["1", "integer"], ["1.0", "double"], ['"x"', "string"], ["[1,2.5]", "double_array"], ["[1]", "integer_array"], ["[]", "string_array"], ["[true]", "bool_array"]])(
  "%s is a %s",
  (text, kind) => expect(kindOf(readJson(text))).toBe(kind),
);
