/** A type's shape as forms need it: an empty message, what each field takes, and where a value lies. */

import type { FieldShape, TypeShape } from "../api/introspect";
import { blank, Exact, isObject, type Json, type JsonObject } from "../values/json";
import type { Field } from "../values/values";

export type Step = string | number;

const RANGES: Record<string, [number, number]> = {
  byte: [0, 255],
  char: [0, 255],
  int8: [-128, 127],
  uint8: [0, 255],
  int16: [-32768, 32767],
  uint16: [0, 65535],
  int32: [-2147483648, 2147483647],
  uint32: [0, 4294967295],
  int64: [-(2 ** 63), 2 ** 63],
  uint64: [0, 2 ** 64],
};
const MAX_FIXED = 4096;

export const isNested = ({ type }: FieldShape) => type.includes("/");

/** Whether a message is a few plain values, which find room in one line: a vector, a stamp. */
export const isSmall = (shape: TypeShape, name: string) => {
  const fields = shape.definitions[name]?.fields ?? [];
  return fields.length > 0 && fields.length <= 4 && fields.every((field) => !isNested(field) && field.array === "" && field.type !== "string");
};

/** A message with every field at its default. */
export function blankMessage(shape: TypeShape, name: string): JsonObject {
  const message = blank();
  for (const field of shape.definitions[name]?.fields ?? []) message[field.name] = blankField(shape, field);
  return message;
}

function blankField(shape: TypeShape, field: FieldShape): Json {
  if (field.default !== null) return field.default;
  if (field.array === "fixed") return Array.from({ length: Math.min(field.capacity, MAX_FIXED) }, () => blankItem(shape, field));
  return field.array === "" ? blankItem(shape, field) : [];
}

/** One element of a field that is a list, or its only value. */
export function blankItem(shape: TypeShape, { type }: FieldShape): Json {
  if (type.includes("/")) return blankMessage(shape, type);
  if (type === "bool") return false;
  if (type === "string" || type === "wstring") return "";
  return type.startsWith("float") ? new Exact("0.0") : 0;
}

/** What a field of plain values takes, in the words of the other forms. */
export function fieldOf({ type, array, string_bound: bound }: FieldShape): Exclude<Field, { type: "parameters" }> {
  const list = array === "" ? "" : "_array";
  if (type === "bool") return { type: "value", kind: list ? "bool_array" : "bool", limits: {} };
  if (type === "string" || type === "wstring") return { type: "value", kind: list ? "string_array" : "string", limits: { most: bound || undefined } };
  const range = RANGES[type];
  if (range) return { type: "value", kind: list ? "integer_array" : "integer", limits: { range: { from: range[0], to: range[1], step: 0 } } };
  return { type: "value", kind: list ? "double_array" : "double", limits: {} };
}

/** "float64[36]" as in the definition; of a message the last word of its name. */
export function typeText({ type, array, capacity, string_bound: bound }: FieldShape): string {
  const word = type.slice(type.lastIndexOf("/") + 1) + (bound ? `<=${bound}` : "");
  return array === "" ? word : `${word}[${array === "fixed" ? capacity : array === "bounded" ? `<=${capacity}` : ""}]`;
}

/** Why a list has the wrong length, or "". */
export function lengthProblem({ array, capacity }: FieldShape, length: number): string {
  if (array === "fixed" && length !== capacity) return `${length} of ${capacity} values`;
  return array === "bounded" && length > capacity ? `${length} values, at most ${capacity}` : "";
}

/** A copy with another value there. */
export function placed(value: Json, [first, ...rest]: readonly Step[], item: Json): Json {
  if (first === undefined) return item;
  if (Array.isArray(value)) return value.map((one, i) => (i === first ? placed(one, rest, item) : one));
  const next = Object.assign(blank(), isObject(value) ? value : {});
  next[first] = placed(next[first] ?? null, rest, item);
  return next;
}
