/** Typed calls for alerts, silences, checks, and what the gateway expects of series. Times go in as milliseconds. */

import { call } from "./call";
import { rfc3339 } from "./history";
import type { BodyOf } from "./operation.js";
import type { Alert, AlertCheck } from "./schema.js";

export type { Alert, AlertCheck, AlertDetail, AlertFinding, AlertRemark, SeriesWatch, Silence } from "./schema.js";
export type Severity = Alert["severity"];
export type AlertState = Alert["state"];
/** [stamp_ms, value, low, high, score] */
export type BandPoint = readonly [number, number | null, number | null, number | null, number];
export type CheckChange = Partial<Pick<AlertCheck, "enabled" | "low" | "high" | "for_s" | "clear_s" | "severity">>;
export type SilenceOrder = BodyOf<"POST /silences">;

const MANY = 1000;

export interface AlertQuery {
  robot?: string;
  fromMs?: number;
  untilMs?: number;
  limit: number;
}

const timed = (ms: number | undefined) => (ms === undefined ? undefined : rfc3339(Math.round(ms)));
const one = (id: string) => ({ path: { alert_id: id } });
const said = (id: string, text: string) => ({ ...one(id), body: { text } });

export const alertsApi = {
  /** The newest first; with times those that were not resolved at some time in between. */
  list: ({ robot, fromMs, untilMs, limit }: AlertQuery) =>
    call("GET /alerts", { query: { robot: robot === undefined ? undefined : [robot], from: timed(fromMs), until: timed(untilMs), limit } }),
  get: (id: string) => call("GET /alerts/{alert_id}", one(id)),
  acknowledge: (id: string, text = "") => call("POST /alerts/{alert_id}/acknowledge", said(id, text)),
  unacknowledge: (id: string, text = "") => call("POST /alerts/{alert_id}/unacknowledge", said(id, text)),
  resolve: (id: string, text = "") => call("POST /alerts/{alert_id}/resolve", said(id, text)),
  comment: (id: string, text: string) => call("POST /alerts/{alert_id}/comments", said(id, text)),
  assign: (id: string, assignee: string) => call("POST /alerts/{alert_id}/assign", { ...one(id), body: { assignee } }),
  normal: (id: string, text: string) => call("POST /alerts/{alert_id}/normal", said(id, text)),
  silence: (id: string, forS: number, reason: string) => call("POST /alerts/{alert_id}/silence", { ...one(id), body: { for_s: forS, reason } }),
  clip: (id: string) => call("POST /alerts/{alert_id}/clip", { ...one(id), body: {} }),

  silences: async () => (await call("GET /silences", { query: { limit: MANY } })).silences,
  addSilence: (order: SilenceOrder) => call("POST /silences", { body: order }),
  endSilence: (id: string) => call("DELETE /silences/{silence_id}", { path: { silence_id: id } }),

  checks: async () => (await call("GET /alert-checks", { query: { limit: MANY } })).checks,
  setCheck: (id: string, change: CheckChange) => call("PUT /alert-checks/{check_id}", { path: { check_id: id }, body: change }),
  resetCheck: (id: string) => call("DELETE /alert-checks/{check_id}", { path: { check_id: id } }),

  watch: async (robot: string) => (await call("GET /robots/{robot_id}/watch", { path: { robot_id: robot }, query: { limit: MANY } })).series,
  band: async (robot: string, series: string, fromMs: number, toMs: number) =>
    (await call("GET /robots/{robot_id}/watch/band", { path: { robot_id: robot }, query: { series, from: timed(fromMs), to: timed(toMs) } })).points as unknown as BandPoint[],
};
