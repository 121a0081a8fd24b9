/** Typed calls for rules: what there is, changes with their revision, checks, dry runs, schedules and hooks. */

import { writeJson, type Json, type JsonObject } from "../values/json";
import { call } from "./call";
import { request } from "./client";
import { askExact } from "./exact";
import type { BodyOf } from "./operation.js";
import type { Rule as ToldRule, RuleChange as ToldChange } from "./schema.js";

export type { DryFiring, DryRunResult, Hook, HookMade, RuleFault, RuleStats, Schedule as RuleSchedule } from "./schema.js";
/** A rule with its document as it is written: 10.0 stays 10.0. */
export type Rule = Omit<ToldRule, keyof Document> & Document;
export type RuleChange = Omit<ToldChange, "document"> & { document: JsonObject };
export type HookOrder = BodyOf<"POST /hooks">;

export interface Document {
  name: string;
  description?: string;
  enabled?: boolean;
  pattern?: JsonObject | null;
  until?: JsonObject | null;
  topic?: JsonObject | null;
  metric?: JsonObject | null;
  schedule?: JsonObject | null;
  when?: JsonObject | null;
  event_format?: string;
  targets?: JsonObject[];
}

const MANY = 1000;
const one = (name: string) => `/rules/${encodeURIComponent(name)}`;
const held = (revision: number) => ({ "content-type": "application/json", "if-match": `"${revision}"` });

export const rulesApi = {
  list: async () => (await askExact<{ rules: Rule[] }>(`/rules?limit=${MANY}`)).rules,
  get: (name: string) => askExact<Rule>(one(name)),
  /** Revision 0: there is none of that name yet. Refused where somebody else changed it meanwhile. */
  put: (document: JsonObject, revision: number) =>
    askExact<Rule>(one(String(document.name)), { method: "PUT", headers: held(revision), body: writeJson(document) }),
  turn: (name: string, on: boolean) => request<ToldRule>(`${one(name)}/${on ? "enable" : "disable"}`, { method: "POST", body: "{}" }),
  remove: (name: string, revision: number) => request<null>(one(name), { method: "DELETE", headers: held(revision) }),
  history: async (name: string) => (await askExact<{ entries: RuleChange[] }>(`${one(name)}/history?limit=100`)).entries,
  check: async (document: Json) => (await call("POST /rules/check", { body: JSON.parse(writeJson(document)) as Record<string, unknown> })).faults,
  dryRun: (document: Json, from: string, limit: number) =>
    call("POST /rules/dry-run", { body: { rule: JSON.parse(writeJson(document)) as Record<string, unknown>, from, until: "now", limit } }),
  secret: async (name: string, target: string) => (await call("POST /rules/{name}/targets/{target}/secret", { path: { name, target }, body: {} })).secret,

  schedules: async () => (await call("GET /schedules", { query: { limit: MANY } })).schedules,
  preview: async (expression: string, timezone: string, count: number) => (await call("POST /schedules/preview", { body: { expression, timezone, count } })).times,

  hooks: async () => (await call("GET /hooks", { query: { limit: MANY } })).hooks,
  addHook: (order: HookOrder) => call("POST /hooks", { body: order }),
  rotateHook: async (hook: string) => (await call("POST /hooks/{hook}/rotate", { path: { hook }, body: {} })).secret,
  removeHook: (hook: string) => call("DELETE /hooks/{hook}", { path: { hook } }),
};
