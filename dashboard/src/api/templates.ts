/** Typed calls for templates: partial twins of all robots that a selector names. */

import type { Change } from "../twin/document";
import type { JsonObject, Numeric } from "../values/json";
import { askExact, sendExact } from "./exact";
import type { TwinChange } from "./twin";

export interface Template {
  name: string;
  selector: string;
  priority: number;
  revision: number;
  author: string;
  at: string;
  reason: string;
  document: JsonObject;
}

/** A template as it was after one of its changes. */
export interface TemplateEntry extends Template {
  /** It was deleted then. */
  removed: boolean;
  changes: Change[];
}

/** What one does, or would do, to the robots that it reaches. */
export interface TemplateChange {
  dry_run: boolean;
  template: Template;
  robots: Numeric;
  changed: Numeric;
  results: TwinChange[];
}

export interface TemplateOptions {
  dryRun: boolean;
  reason: string;
  confirmWithinS: number;
  /** The revision that the person has seen: another one is refused. 0: there was none. */
  seen: number;
}

function place(name: string, { dryRun, reason, confirmWithinS }: TemplateOptions, below = ""): string {
  const query = new URLSearchParams({ confirm_within_s: String(confirmWithinS) });
  if (dryRun) query.set("dry_run", "true");
  if (reason) query.set("reason", reason);
  return `/templates/${encodeURIComponent(name)}${below}?${query}`;
}

const seenHeader = ({ seen }: TemplateOptions) => ({ "if-match": `"${seen}"` });

export const templatesApi = {
  list: async () => (await askExact<{ templates: Template[] }>("/templates")).templates,
  put: (name: string, body: { selector: string; priority: number; document: JsonObject }, options: TemplateOptions) =>
    sendExact<TemplateChange>("PUT", place(name, options), body, seenHeader(options)),
  history: async (name: string, limit: number) => (await askExact<{ entries: TemplateEntry[] }>(`/templates/${encodeURIComponent(name)}/history?limit=${limit}`)).entries,
  revert: (name: string, revision: number, options: TemplateOptions) =>
    sendExact<TemplateChange>("POST", place(name, options, "/revert"), { revision }, seenHeader(options)),
  remove: (name: string, options: TemplateOptions) => sendExact<TemplateChange>("DELETE", place(name, options), {}, seenHeader(options)),
};
