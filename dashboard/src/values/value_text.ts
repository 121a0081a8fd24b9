/** Values as text: strings without quotes, everything else as JSON. */

import { isObject, type Json } from "./json";

export function shown(value: Json | undefined): string {
  if (value === undefined) return "–";
  if (typeof value === "string") return value === "" ? "“”" : value;
  if (value === null) return "taken away";
  if (Array.isArray(value)) return value.length === 0 ? "[]" : value.map(shown).join(", ");
  if (isObject(value)) return Object.keys(value).length === 0 ? "{}" : Object.entries(value).map(([key, item]) => `${key} ${shown(item)}`).join(", ");
  return String(value);
}
