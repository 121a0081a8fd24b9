/** The gateway's JSON Schema of a twin's document, as the form reads it. */

import { isNumeric, isObject, type Json, type JsonObject } from "../values/json";
import type { Field, Limits } from "../values/values";
import { at } from "./document";

export interface KeySpec {
  key: string;
  meaning: string;
  fallback: Json | undefined;
  field: Field;
}

export interface SectionSpec {
  section: string;
  meaning: string;
  /** Null: the section is one row itself. */
  name: { pattern: string; most: number } | null;
  /** The keys of a row; null: what a row holds is said by `row`. */
  keys: KeySpec[] | null;
  row: Field | null;
}

export function sectionsOf(schema: JsonObject): SectionSpec[] {
  const sections = at(schema, ["properties"]);
  return Object.entries(isObject(sections) ? sections : {}).flatMap(([section, one]) => {
    if (!isObject(one)) return [];
    const row = isObject(one.additionalProperties) ? one.additionalProperties : null;
    const names = isObject(one.propertyNames) ? one.propertyNames : {};
    return [{
      section,
      meaning: text(one.description),
      name: row && { pattern: text(names.pattern), most: isNumeric(names.maxLength) ? Number(names.maxLength) : 256 },
      keys: keysOf(row ?? one),
      row: row && !isObject(row.properties) ? fieldOf(row) : null,
    }];
  });
}

function keysOf(row: JsonObject): KeySpec[] | null {
  if (!isObject(row.properties)) return null;
  return Object.entries(row.properties).flatMap(([key, one]) =>
    isObject(one) ? [{ key, meaning: text(one.description), fallback: one.default, field: fieldOf(one) }] : [],
  );
}

function fieldOf(one: JsonObject): Field {
  if (Array.isArray(one.enum)) return { type: "choice", words: one.enum.map(String) };
  if (Array.isArray(one.anyOf)) {
    const bounded = one.anyOf.filter(isObject).find(({ type }) => type === "integer" || type === "number");
    const zero = one.anyOf.some((item) => isObject(item) && isNumeric(item.const) && Number(item.const) === 0);
    if (!zero || !bounded) return { type: "any" };
    const field = fieldOf(bounded);
    return field.type === "value" ? { ...field, limits: { ...field.limits, zero } } : field;
  }
  switch (one.type) {
    case "boolean":
      return { type: "value", kind: "bool", limits: {} };
    case "integer":
    case "number":
      return { type: "value", kind: one.type === "integer" ? "integer" : "double", limits: { range: rangeOf(one) } };
    case "string":
      return { type: "value", kind: "string", limits: limitsOf(one) };
    case "array":
      return { type: "value", kind: "string_array", limits: isObject(one.items) ? limitsOf(one.items) : {} };
    case "object":
      return { type: "parameters" };
    default:
      return { type: "any" };
  }
}

const text = (value: Json | undefined) => (typeof value === "string" ? value : "");
const limitsOf = ({ pattern, minLength, maxLength }: JsonObject): Limits => ({
  pattern: text(pattern) || undefined,
  least: isNumeric(minLength) ? Number(minLength) : undefined,
  most: isNumeric(maxLength) ? Number(maxLength) : undefined,
});
const rangeOf = ({ minimum, maximum }: JsonObject) =>
  isNumeric(minimum) && isNumeric(maximum) ? { from: Number(minimum), to: Number(maximum), step: 0 } : null;
