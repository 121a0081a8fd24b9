/** A message as rows of text for the key-value card: nested names are indented, long arrays are summarised. */

import { short } from "../ui/format";

export interface Row {
  depth: number;
  name: string;
  value: string;
}

export const MAX_ROWS = 200;
const MAX_ITEMS = 6;
const MAX_TEXT = 200;

const isNumbers = (value: object): value is ArrayLike<number | bigint> => ArrayBuffer.isView(value) && !(value instanceof DataView);

function scalar(value: unknown): string {
  if (typeof value === "number") return short(value);
  if (typeof value === "string") return value.length > MAX_TEXT ? `${value.slice(0, MAX_TEXT)}… (${value.length})` : value;
  return String(value);
}

function list(values: ArrayLike<unknown>): string {
  const shown = Array.from({ length: Math.min(values.length, MAX_ITEMS) }, (_, i) => scalar(values[i]));
  return values.length > MAX_ITEMS ? `[${shown.join(", ")}, … ${values.length}]` : `[${shown.join(", ")}]`;
}

export function treeRows(message: object): Row[] {
  const rows: Row[] = [];
  const walk = (name: string, value: unknown, depth: number) => {
    if (rows.length >= MAX_ROWS) return;
    if (value === null || typeof value !== "object") {
      rows.push({ depth, name, value: scalar(value) });
    } else if (isNumbers(value)) {
      rows.push({ depth, name, value: list(value) });
    } else if (Array.isArray(value)) {
      const nested = value.some((item) => typeof item === "object" && item !== null);
      rows.push({ depth, name, value: nested ? `${value.length} items` : list(value) });
      if (nested) value.slice(0, MAX_ITEMS).forEach((item, i) => walk(String(i), item, depth + 1));
    } else if ("sec" in value && "nanosec" in value) {
      rows.push({ depth, name, value: `${String(value.sec)}.${String(value.nanosec).padStart(9, "0")} s` });
    } else {
      rows.push({ depth, name, value: "" });
      for (const [key, item] of Object.entries(value)) walk(key, item, depth + 1);
    }
  };
  for (const [key, item] of Object.entries(message)) walk(key, item, 0);
  return rows;
}
