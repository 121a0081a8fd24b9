/** Typed calls for functions: what there is, calls of them, logs, code, versions, canaries, and dead letters. */

import { call } from "./call";
import { BASE_PATH, request } from "./client";
import type { AnswerOf, BodyOf, QueryOf } from "./operation.js";
import type { FunctionDetail } from "./schema.js";

export type { Alias, Canary, CodeFile, CodeText, DeadLetter, FunctionDetail, Invocation, Invoked, Runtime, Stats, Trigger } from "./schema.js";
export type { Function as FunctionRow } from "./schema.js";
export type LogLine = AnswerOf<"GET /functions/{name}/logs">["lines"][number];
export type InvocationQuery = QueryOf<"GET /functions/{name}/invocations">;
export type CanaryOrder = BodyOf<"PUT /functions/{name}/aliases/{alias}/canary">;
export type Settings = Omit<BodyOf<"PUT /functions/{name}">, "zip">;

const MANY = 1000;
/** An upload of tens of megabytes over a slow line takes its time; the gateway has its own bound. */
const UPLOAD = "application/zip";

const of = (name: string) => ({ path: { name } });
const ofAlias = (name: string, alias: string) => ({ path: { name, alias } });
const one = (name: string) => `/functions/${encodeURIComponent(name)}`;

/** Which dead letters: some, or all of a target, or every one. */
export interface DeadChoice {
  ids?: string[];
  kind?: string;
  target?: string;
  all?: boolean;
}

export interface Upload {
  handler?: string;
  publish?: boolean;
  alias?: string;
}

export const functionsApi = {
  list: async (windowS: number) => (await call("GET /functions", { query: { window_s: windowS, limit: MANY } })).functions,
  get: (name: string, windowS: number) => call("GET /functions/{name}", { ...of(name), query: { window_s: windowS } }),
  set: (name: string, settings: Settings) => call("PUT /functions/{name}", { ...of(name), body: settings }),
  remove: (name: string) => call("DELETE /functions/{name}", of(name)),
  runtime: () => call("GET /functions-runtime"),

  invocations: (name: string, query: InvocationQuery) => call("GET /functions/{name}/invocations", { ...of(name), query }),
  /** The payload is sent as it was typed: a number stays as it was written. */
  invoke: (name: string, payload: string, qualifier: string, kind: "request" | "event") =>
    request<AnswerOf<"POST /functions/{name}/invoke">>(`${one(name)}/invoke?${new URLSearchParams({ qualifier, kind })}`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: payload,
    }),

  log: (name: string, limit: number) => call("GET /functions/{name}/logs", { ...of(name), query: { limit } }),
  tailUrl: (name: string, after: number | null) => `${BASE_PATH}${one(name)}/logs${after === null ? "" : `?after=${after}`}`,

  code: (name: string, version: string) => call("GET /functions/{name}/code", { ...of(name), query: { version } }),
  text: (name: string, version: string, path: string) => call("GET /functions/{name}/code/text", { ...of(name), query: { version, path } }),
  upload: (name: string, zip: Blob, { handler = "", publish = false, alias = "" }: Upload) =>
    request<FunctionDetail>(`${one(name)}/code?${new URLSearchParams({ handler, publish: String(publish), alias })}`, { method: "PUT", headers: { "content-type": UPLOAD }, body: zip }),

  publish: (name: string, description: string) => call("POST /functions/{name}/versions", { ...of(name), body: { description } }),
  setAlias: (name: string, alias: string, version: string, weights: Record<string, number>) =>
    call("PUT /functions/{name}/aliases/{alias}", { ...ofAlias(name, alias), body: { version, weights } }),
  removeAlias: (name: string, alias: string) => call("DELETE /functions/{name}/aliases/{alias}", ofAlias(name, alias)),
  startCanary: (name: string, alias: string, order: CanaryOrder) => call("PUT /functions/{name}/aliases/{alias}/canary", { ...ofAlias(name, alias), body: order }),
  stopCanary: (name: string, alias: string) => call("DELETE /functions/{name}/aliases/{alias}/canary", ofAlias(name, alias)),

  dead: (kind: string, target: string, limit: number) => call("GET /dead-letters", { query: { kind, target, limit } }),
  deadLetter: (id: string) => call("GET /dead-letters/{letter_id}", { path: { letter_id: id } }),
  redrive: async (choice: DeadChoice) => (await call("POST /dead-letters/redrive", { body: choice })).redriven,
  drop: async ({ ids = [], kind, target, all }: DeadChoice) => (await call("DELETE /dead-letters", { query: { id: ids, kind, target, all } })).dropped,
};
