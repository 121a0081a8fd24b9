/** Typed values as people write them: what is in a field becomes a value of its kind, or a sentence why not. */

import { Exact, isNumeric, isObject, numeric, type Json } from "./json";

export type Kind = "bool" | "integer" | "double" | "string" | "byte_array" | "bool_array" | "integer_array" | "double_array" | "string_array";

export const KIND_WORDS: Record<Kind, string> = {
  bool: "true or false",
  integer: "whole number",
  double: "number",
  string: "text",
  byte_array: "bytes",
  bool_array: "list of true/false",
  integer_array: "list of whole numbers",
  double_array: "list of numbers",
  string_array: "list of texts",
};

export const isList = (kind: Kind) => kind.endsWith("_array");

/** The kind that a value of a document has. */
export function kindOf(value: Json): Kind {
  if (Array.isArray(value)) {
    const kinds = value.map(kindOf);
    if (kinds.every((kind) => kind === "bool") && kinds.length > 0) return "bool_array";
    if (kinds.every((kind) => kind === "integer") && kinds.length > 0) return "integer_array";
    return kinds.every((kind) => kind === "integer" || kind === "double") && kinds.length > 0 ? "double_array" : "string_array";
  }
  if (typeof value === "boolean") return "bool";
  if (!isNumeric(value)) return "string";
  return /[.eE]/.test(String(value)) ? "double" : "integer";
}

/** What a new value of a kind starts as. */
export const BLANK: Record<Kind, Json> = {
  bool: false,
  integer: 0,
  double: new Exact("0.0"),
  string: "",
  byte_array: [],
  bool_array: [],
  integer_array: [],
  double_array: [],
  string_array: [],
};

export const textOf = (value: Json | undefined): string =>
  value === undefined || value === null || isObject(value) ? "" : Array.isArray(value) ? value.map(String).join(value.some((item) => typeof item === "string") ? "\n" : ", ") : String(value);

export interface Range {
  from: number;
  to: number;
  step: number;
}

export interface Limits {
  range?: Range | null;
  /** Zero is taken as well, where the range does not hold it. */
  zero?: boolean;
  /** Numbers that JSON has not are taken, as text. */
  special?: boolean;
  pattern?: string;
  least?: number;
  most?: number;
}

/** What a field takes. */
export type Field =
  | { type: "value"; kind: Kind; limits: Limits }
  | { type: "choice"; words: string[] }
  /** ROS parameters by name. */
  | { type: "parameters" }
  /** A ROS parameter of any kind. */
  | { type: "any" };

export type Parsed = { value: Json } | { problem: string };

export function parsed(kind: Kind, text: string, limits: Limits = {}): Parsed {
  if (!isList(kind)) return scalar(kind, text, limits);
  const parts = kind === "string_array" ? text.split("\n").filter((line, i, all) => line !== "" || i < all.length - 1) : text.split(/[\s,]+/).filter(Boolean);
  const item = kind === "byte_array" ? "integer" : (kind.replace("_array", "") as Kind);
  const bounds = kind === "byte_array" ? { range: { from: 0, to: 255, step: 1 } } : limits;
  const found: Json[] = [];
  for (const [i, part] of parts.entries()) {
    const one = scalar(item, part, bounds);
    if ("problem" in one) return { problem: `item ${i + 1}: ${one.problem}` };
    found.push(one.value);
  }
  return { value: found };
}

function scalar(kind: Kind, typed: string, limits: Limits): Parsed {
  const text = kind === "string" ? typed : typed.trim();
  if (kind === "string") return textual(text, limits);
  if (kind === "bool") return text === "true" || text === "false" ? { value: text === "true" } : { problem: "true or false" };
  if (limits.special && kind === "double" && /^([+-]?inf|nan)$/i.test(text)) return { value: text.toLowerCase() };
  const value = numeric(text.replace(/^\+/, "").replace(/^(-?)\./, "$10.").replace(/\.$/, ".0"));
  const whole = kind === "integer";
  if (value === null) return { problem: whole ? "a whole number" : "a number" };
  if (whole && /[.eE]/.test(String(value))) return { problem: "a whole number, without a point" };
  const problem = outside(Number(value), limits);
  if (problem) return { problem };
  return { value: whole || /[.eE]/.test(String(value)) ? value : new Exact(`${value}.0`) }; // 10 would be another type
}

function outside(value: number, { range, zero }: Limits): string {
  if (!range || (zero && value === 0)) return "";
  const { from, to, step } = range;
  if (value < from || value > to) return rangeWords({ range, zero });
  const steps = (value - from) / step;
  // A range need not end on a step: its end is allowed too.
  if (step > 0 && value !== to && Math.abs(steps - Math.round(steps)) > 1e-6) return `${from} and steps of ${step}`;
  return "";
}

export function rangeWords({ range, zero }: Limits): string {
  if (!range) return "";
  const span = `${number(range.from)} to ${number(range.to)}${range.step > 0 && range.step !== 1 ? `, steps of ${range.step}` : ""}`;
  return zero ? `0, or ${span}` : span;
}

const number = (value: number) => (Math.abs(value) >= 1e7 ? value.toExponential(1).replace("e+", "e") : String(value));

function textual(text: string, { pattern, least = 0, most = Infinity }: Limits): Parsed {
  if (text.length < least) return { problem: least === 1 ? "must not be empty" : `at least ${least} characters` };
  if (text.length > most) return { problem: `at most ${most} characters` };
  if (pattern && !new RegExp(pattern, "u").test(text)) return { problem: "letters that it does not take" };
  return { value: text };
}
