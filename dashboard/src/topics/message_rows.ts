/** A message as the rows of a tree that can be opened and closed, in the order of its fields. */

import { short } from "../ui/format";
import { blank, Exact, writeJson, type Json } from "../values/json";

export interface Row {
  /** Unique in the message, the same from message to message. */
  path: string;
  depth: number;
  name: string;
  value: string;
  /** Null: there is nothing inside. */
  open: boolean | null;
}

export const MAX_ROWS = 1000;
const MAX_TEXT = 400;
const MAX_INLINE = 8;
const MAX_ITEMS = 200;
/** So many items of a list of messages are open from the start. */
const FEW = 4;

type Numbers = ArrayLike<number | bigint>;
const isNumbers = (value: unknown): value is Numbers => ArrayBuffer.isView(value) && !(value instanceof DataView);
const isStamp = (value: object): value is { sec: number; nanosec: number } => "sec" in value && "nanosec" in value && Object.keys(value).length === 2;

function scalar(value: unknown): string {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : Number.isFinite(value) ? short(value) : String(value);
  if (typeof value === "string") return value.length > MAX_TEXT ? `${value.slice(0, MAX_TEXT)}… (${value.length} letters)` : value;
  return String(value);
}

function inline(values: ArrayLike<unknown>): string {
  const shown = Array.from({ length: Math.min(values.length, MAX_INLINE) }, (_, i) => scalar(values[i]));
  return values.length > MAX_INLINE ? `[${shown.join(", ")}, …]` : `[${shown.join(", ")}]`;
}

/** What is inside of a value: names with values, or null for what is one line. */
function inside(value: unknown): [string, unknown][] | null {
  if (value === null || typeof value !== "object" || value instanceof Date) return null;
  if (isNumbers(value)) return value.length > MAX_INLINE ? items(value) : null;
  if (Array.isArray(value)) return value.length > MAX_INLINE || value.some((item) => typeof item === "object") ? items(value) : null;
  return isStamp(value) ? null : Object.entries(value);
}

const items = (values: ArrayLike<unknown>): [string, unknown][] => Array.from({ length: Math.min(values.length, MAX_ITEMS) }, (_, i) => [String(i), values[i]]);

function summary(value: unknown): string {
  if (isNumbers(value) || Array.isArray(value)) {
    const nested = Array.isArray(value) && value.some((item) => typeof item === "object");
    const many = `${value.length} ${value.length === 1 ? "item" : "items"}`;
    return nested ? many : value.length > MAX_INLINE ? `${inline(value)} ${many}` : inline(value);
  }
  if (value !== null && typeof value === "object") return isStamp(value) ? `${value.sec}.${String(value.nanosec).padStart(9, "0")} s` : "";
  return scalar(value);
}

const opensByItself = (value: unknown, depth: number) => !isNumbers(value) && (Array.isArray(value) ? value.length <= FEW : depth < 3);

/** `turned`: the paths that are the other way round than they would be by themselves. */
export function messageRows(message: object, turned: ReadonlySet<string>): Row[] {
  const rows: Row[] = [];
  const walk = (name: string, value: unknown, path: string, depth: number) => {
    if (rows.length >= MAX_ROWS) return;
    const below = inside(value);
    const open = below && below.length > 0 ? opensByItself(value, depth) !== turned.has(path) : null;
    rows.push({ path, depth, name, value: summary(value), open });
    if (!open) return;
    for (const [key, item] of below!) walk(key, item, `${path}.${key}`, depth + 1);
    const total = (value as ArrayLike<unknown>).length;
    if (below!.length < total) rows.push({ path: `${path}.…`, depth: depth + 1, name: "…", value: `${total - below!.length} more`, open: null });
  };
  for (const [key, item] of Object.entries(message)) walk(key, item, key, 0);
  return rows;
}

/** As JSON that a person may paste: lists in full, whole numbers of 64 bits to the last digit. */
export const asJson = (message: object): string => writeJson(plain(message), 2);

function plain(value: unknown): Json {
  if (typeof value === "bigint") return new Exact(String(value));
  if (typeof value === "number") return Number.isFinite(value) ? value : null;
  if (typeof value === "string" || typeof value === "boolean") return value;
  if (isNumbers(value)) return Array.from(value as ArrayLike<unknown>, plain);
  if (Array.isArray(value)) return value.map(plain);
  const found = blank();
  for (const [key, item] of Object.entries(value ?? {})) found[key] = plain(item);
  return found;
}
