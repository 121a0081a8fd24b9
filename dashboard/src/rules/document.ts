/** A rule's document while it is edited: its text is what counts, the form reads and writes parts of it. */

import type { Document, Rule, RuleFault } from "../api/rules";
import { copy, isObject, readJson, writeJson, type Json, type JsonObject } from "../values/json";
import type { Source } from "./words";

export const INDENT = 2;
const FIELDS = ["name", "description", "enabled", "pattern", "until", "topic", "metric", "schedule", "when", "event_format", "targets"] as const;

/** What a rule says, without what the gateway says about it, and without what is as usual. */
export function documentOf(rule: Rule | Document): JsonObject {
  const found: JsonObject = {};
  for (const field of FIELDS) {
    const value = rule[field] as Json | undefined;
    const usual = value == null || (field === "description" && value === "") || (field === "event_format" && value === "eventbridge");
    if (!usual) found[field] = value;
  }
  return found;
}

export const textOf = (document: Json) => writeJson(document, INDENT);

export type Read = { document: JsonObject; problem: "" } | { document: null; problem: string };

export function read(text: string): Read {
  try {
    const document = readJson(text);
    return isObject(document) ? { document, problem: "" } : { document: null, problem: "A rule is a JSON object." };
  } catch (error) {
    return { document: null, problem: `No JSON: ${error instanceof Error ? error.message : String(error)}` };
  }
}

/** A document with one place changed: `["targets", 0, "url"]`; undefined takes it away. The others stay. */
export function withPlace(document: JsonObject, place: readonly (string | number)[], value: Json | undefined): JsonObject {
  const changed = copy(document);
  let at: Json = changed;
  for (const [i, step] of place.slice(0, -1).entries()) {
    const holder = at as JsonObject;
    if (typeof holder[step] !== "object" || holder[step] === null) holder[step] = typeof place[i + 1] === "number" ? [] : {};
    at = holder[step]!;
  }
  const last = place.at(-1)!;
  if (value !== undefined) (at as JsonObject)[last] = value;
  else if (Array.isArray(at)) at.splice(Number(last), 1);
  else delete (at as JsonObject)[last];
  return changed;
}

const EMPTY: Record<Source, Json> = {
  pattern: { "detail-type": ["metaros.alert.opened"] },
  topic: { topic: "/battery_state", robots: ["*"] },
  metric: { series: "battery_state.percentage", robots: ["*"], below: 0.2 },
  schedule: { expression: "rate(1 hour)", timezone: "UTC", misfire: "skip" },
};

/** Listens to another source; a schedule goes without a condition. */
export function withSource(document: JsonObject, source: Source): JsonObject {
  const changed = copy(document);
  for (const other of ["pattern", "topic", "metric", "schedule"]) delete changed[other];
  if (source === "schedule") for (const other of ["when", "until"]) delete changed[other];
  const kept: JsonObject = {};
  for (const field of FIELDS) {
    if (field === source) kept[field] = copy(EMPTY[source]);
    else if (changed[field] !== undefined) kept[field] = changed[field];
  }
  return kept;
}

export const NEW: JsonObject = {
  name: "",
  enabled: true,
  pattern: { "detail-type": ["metaros.alert.opened"], detail: { severity: ["error"] } },
  targets: [],
};

/** The fault that belongs to a place of the form: at it, or within it. "targets[0].url" */
export function faultAt(faults: readonly RuleFault[], path: string): string {
  const found = faults.find((fault) => fault.path === path || fault.path.startsWith(`${path}.`) || fault.path.startsWith(`${path}[`));
  if (!found) return "";
  const within = found.path.slice(path.length).replace(/^\./, "");
  return within ? `${within}: ${found.message}` : found.message;
}

/** The line (from 0) of the document's text on which a path begins; -1 where there is no such place. */
export function lineOf(document: Json, path: string): number {
  const steps = [...path.matchAll(/([^.[\]]+)|\[(\d+)\]/g)].map((match) => match[1] ?? Number(match[2]));
  const mark = "\u0001here";
  let at: Json = copy(document);
  const root = at;
  for (const [i, step] of steps.entries()) {
    const holder: Json | undefined = typeof at === "object" && at !== null ? (at as JsonObject)[step] : undefined;
    if (holder === undefined) break;
    const isLast = i === steps.length - 1 || typeof holder !== "object" || holder === null || (holder as JsonObject)[steps[i + 1]!] === undefined;
    if (isLast) {
      const deep = isObject(holder); // an object stays one: a list of texts would be written on one line
      (at as JsonObject)[step] = deep ? { [mark]: 0 } : mark;
      return textOf(root).split("\n").findIndex((line) => line.includes(JSON.stringify(mark))) - Number(deep);
    }
    at = holder;
  }
  return -1;
}
