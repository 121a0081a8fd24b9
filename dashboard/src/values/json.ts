/** JSON in which a number stays as it was written: 10.0 is another ROS parameter than 10, and 2^60 is no double. */

export type Json = null | boolean | number | Exact | string | Json[] | JsonObject;
export interface JsonObject {
  [key: string]: Json;
}

/** A number that JavaScript would write otherwise than it was read. */
export class Exact {
  constructor(readonly text: string) {}

  valueOf(): number {
    return Number(this.text);
  }

  toString(): string {
    return this.text;
  }

  /** For whoever does not care: an ordinary number. */
  toJSON(): number {
    return Number(this.text);
  }
}

export type Numeric = number | Exact;

export const isNumeric = (value: unknown): value is Numeric => typeof value === "number" || value instanceof Exact;
export const isObject = (value: unknown): value is JsonObject =>
  typeof value === "object" && value !== null && !Array.isArray(value) && !(value instanceof Exact);

/** A number as it is to be written; null where the text is none that JSON has. */
export function numeric(text: string): Numeric | null {
  if (!/^-?(0|[1-9]\d*)(\.\d+)?([eE][+-]?\d+)?$/.test(text) || !Number.isFinite(Number(text))) return null;
  return String(Number(text)) === text ? Number(text) : new Exact(text);
}

/** An object to fill: a key may be called `__proto__` or `constructor`. */
export const blank = () => Object.create(null) as JsonObject;

const TOKEN = /"(?:[^"\\]|\\.)*"|[{}[\],:]|[^\s{}[\],:"]+/g;

/** Read a document; what is none throws the browser's own SyntaxError, which says where. */
export function readJson(text: string): Json {
  JSON.parse(text);
  const tokens = text.match(TOKEN) ?? [];
  let at = 0;
  const value = (): Json => {
    const token = tokens[at++]!;
    if (token === "{") return object();
    if (token === "[") return list();
    return numeric(token) ?? (JSON.parse(token) as Json);
  };
  const object = (): JsonObject => {
    const found = blank();
    while (tokens[at] !== "}") {
      if (tokens[at] === ",") at += 1;
      const key = JSON.parse(tokens[at]!) as string;
      at += 2; // the key and its colon
      found[key] = value();
    }
    at += 1;
    return found;
  };
  const list = (): Json[] => {
    const found: Json[] = [];
    while (tokens[at] !== "]") {
      if (tokens[at] === ",") at += 1;
      found.push(value());
    }
    at += 1;
    return found;
  };
  return value();
}

/** Write it; lists of plain values stay on one line. Without an indent: all on one line. */
export function writeJson(value: Json, indent = 0, depth = 0): string {
  if (value instanceof Exact) return value.text;
  if (typeof value !== "object" || value === null) return JSON.stringify(value);
  const deeper = (item: Json) => writeJson(item, indent, depth + 1);
  const gap = indent ? " " : "";
  if (Array.isArray(value) && (!indent || value.every((item) => typeof item !== "object" || item === null || item instanceof Exact))) {
    return `[${value.map(deeper).join(`,${gap}`)}]`;
  }
  const items = Array.isArray(value) ? value.map(deeper) : Object.entries(value).map(([key, item]) => `${JSON.stringify(key)}:${gap}${deeper(item)}`);
  const [open, close] = Array.isArray(value) ? "[]" : "{}";
  if (items.length === 0 || !indent) return open + items.join(",") + close;
  const margin = " ".repeat(indent * depth);
  const inner = margin + " ".repeat(indent);
  return `${open}\n${inner}${items.join(`,\n${inner}`)}\n${margin}${close}`;
}

/** Whether two values would be written alike: 10 and 10.0 are two. The order of keys does not count. */
export function same(one: Json | undefined, other: Json | undefined): boolean {
  if (isObject(one) && isObject(other)) {
    const keys = Object.keys(one);
    return keys.length === Object.keys(other).length && keys.every((key) => Object.hasOwn(other, key) && same(one[key], other[key]));
  }
  if (Array.isArray(one) && Array.isArray(other)) return one.length === other.length && one.every((item, i) => same(item, other[i]));
  if (one instanceof Exact && other instanceof Exact) return one.text === other.text;
  return one === other;
}

/** A copy that shares nothing. */
export const copy = <T extends Json>(value: T): T => readJson(writeJson(value)) as T;
