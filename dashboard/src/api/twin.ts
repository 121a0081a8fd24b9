/** Typed calls about twins: what a robot is to be, what it says it is, tried changes, and their history. */

import type { Change } from "../twin/document";
import type { Json, JsonObject, Numeric } from "../values/json";
import { robotPath, type Method } from "./client";
import { askExact, sendExact } from "./exact";

export type TwinWord = "applied" | "applying" | "confirming" | "reverted" | "refused";

export interface TwinReported {
  at: string;
  revision: number;
  applied: number;
  state: TwinWord | "";
  code: string;
  message: string;
  values: JsonObject;
}

export interface Twin {
  robot: string;
  revision: number;
  edition: number;
  in_step: boolean;
  own: JsonObject;
  desired: JsonObject;
  templates: string[];
  labels: Record<string, string>;
  own_labels: Record<string, string>;
  problem: string;
  author: string;
  at: string | null;
  reason: string;
  confirm_within_s: Numeric;
  reported: TwinReported | null;
  behind: Change[];
}

export interface TwinChange {
  robot: string;
  dry_run: boolean;
  revision: number;
  edition: number;
  changed: boolean;
  changes: Change[];
  own_changes: Change[];
  more: number;
}

export interface TwinsChange {
  dry_run: boolean;
  robots: number;
  changed: number;
  results: TwinChange[];
}

export interface TwinEntry {
  revision: number;
  edition: number;
  at: string;
  author: string;
  reason: string;
  changes: Change[];
  own: JsonObject;
  desired: JsonObject;
}

export interface ChangeOptions {
  dryRun: boolean;
  reason?: string;
  confirmWithinS?: number;
  /** The revision and edition that the person has seen: another one is refused. */
  seen?: { revision: number; edition: number };
}

function change<T>(method: Method, path: string, body: Json, options: ChangeOptions, more: Record<string, string> = {}): Promise<T> {
  const query = new URLSearchParams(more);
  if (options.dryRun) query.set("dry_run", "true");
  if (options.reason) query.set("reason", options.reason);
  if (options.confirmWithinS) query.set("confirm_within_s", String(options.confirmWithinS));
  const headers: Record<string, string> = options.seen ? { "if-match": `"${options.seen.revision}.${options.seen.edition}"` } : {};
  return sendExact(method, `${path}${query.size > 0 ? `?${query}` : ""}`, body, headers);
}

const twinPath = (robot: string) => `${robotPath(robot)}/twin`;

export const twinApi = {
  schema: () => askExact<JsonObject>("/twin/schema"),
  get: (robot: string) => askExact<Twin>(twinPath(robot)),
  put: (robot: string, own: JsonObject, options: ChangeOptions) => change<TwinChange>("PUT", twinPath(robot), own, options),
  patchMany: (selector: string, patch: JsonObject, options: ChangeOptions) => change<TwinsChange>("PATCH", "/twins", patch, options, { selector }),
  history: async (robot: string, limit: number) => (await askExact<{ entries: TwinEntry[] }>(`${twinPath(robot)}/history?limit=${limit}`)).entries,
  revert: (robot: string, revision: number, options: ChangeOptions) => change<TwinChange>("POST", `${twinPath(robot)}/revert`, { revision }, options),
  retry: (robot: string, reason: string) => change<TwinChange>("POST", `${twinPath(robot)}/retry`, {}, { dryRun: false, reason }),
};
