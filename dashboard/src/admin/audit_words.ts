/** Rows of the audit log as sentences, and what their answers mean. */

import type { AuditProof, AuditRow } from "../api/admin";
import { ACTS, STORE_ACTS, VIEWER_ACTS } from "./audit_acts";

const PAST: Record<string, string> = {
  acknowledge: "acknowledged", add: "added", ask: "asked", assign: "assigned", begin: "began", call: "called", cancel: "cancelled", change: "changed",
  check: "checked", comment: "commented", delete: "deleted", deliver: "delivered", drive: "drove", drop: "dropped", end: "ended", evaluate: "evaluated", give: "gave",
  keep: "kept", label: "labelled", look: "looked", make: "made", move: "moved", open: "opened", pause: "paused", publish: "published",
  read: "read", renew: "renewed", replace: "replaced", replay: "replayed", reset: "reset", resolve: "resolved", restore: "restored",
  resume: "resumed", revert: "reverted", revoke: "revoked", save: "saved", send: "sent", set: "set", sign: "signed", silence: "silenced", start: "started",
  take: "took", talk: "talked", tell: "told", test: "tested", try: "tried", turn: "turned", upload: "uploaded", watch: "watched", withdraw: "withdrew",
};

/** Names in a path that may have slashes in them. */
const WITH_SLASHES = new Set(["service", "action", "path"]);

interface Act {
  method: string;
  pattern: RegExp;
  words: string;
}

const TABLE: Act[] = Object.entries(ACTS).map(([operation, words]) => {
  const [method, path] = operation.split(" ") as [string, string];
  const parts = path.replaceAll(".", "\\.").replace(/\{(\w+)\}/g, (_, name: string) => `(?<${name}>${WITH_SLASHES.has(name) ? ".+" : "[^/]+"})`);
  return { method, pattern: new RegExp(`^${parts}$`), words };
});

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** What a row is about, without who: "made a key", or "tried to make a key" where that was refused. */
export function actWords(row: AuditRow): string {
  const act = actOf(row);
  if (!act) return [row.method, row.target].filter(Boolean).join(" ") || row.action;
  return outcomeOf(row) === "done" ? act.replace(/^\w+/, (verb) => PAST[verb] ?? verb) : `tried to ${act}`;
}

/** The same as something to do; "" for what is not known. */
function actOf({ method, target, action, kind }: AuditRow): string {
  if (kind === "gateway") return action === "refusals" ? "drop rows about refusals" : "";
  if (method === "CLI") return STORE_ACTS[action] ? `${STORE_ACTS[action]}: ${target}` : "";
  const [place = "", robot = ""] = method === "GRPC" ? target.split(" ") : [target];
  const path = place.replace(/^\/api\/v\d+/, "");
  const viewer = method === "SOCKET" ? /^\/(foxglove|rosbridge)(\/|$)/.exec(path)?.[1] : undefined;
  if (viewer && VIEWER_ACTS[action]) return `${VIEWER_ACTS[action]} by ${viewer === "foxglove" ? "Foxglove" : viewer}`;
  const words = known(method, path) || reading(method, path);
  return words && robot ? `${words}, on ${robot}` : words;
}

function known(method: string, path: string): string {
  for (const act of TABLE) {
    const parts = act.method === method ? act.pattern.exec(path) : null;
    if (parts) return act.words.replace(/\{(\w+)\}/g, (_, name: string) => decoded(parts.groups?.[name] ?? ""));
  }
  return "";
}

/** Of reading only refusals have a row. */
function reading(method: string, path: string): string {
  if (method === "GET") return `read ${path.replace(/^\//, "")}`;
  return method === "GRPC" ? `read ${path.replace("/metaros.v1.", "")} by gRPC` : "";
}

export type Outcome = "done" | "refused" | "failed" | "unknown";

/** How it ended. A socket that opened has 101, the command line 200. */
export function outcomeOf({ status, kind }: AuditRow): Outcome {
  if (status === 0) return kind === "gateway" ? "done" : "unknown";
  if (status < 400) return "done";
  return status === 401 || status === 403 || status === 429 ? "refused" : "failed";
}

/** Who it was, where a row names nobody. */
export function whoWords({ name, kind, action }: AuditRow): string {
  if (kind === "gateway") return "the gateway";
  if (kind !== "anonymous" && name) return name;
  return action === "agent.enrol" || action === "agent.link" ? "a robot" : "somebody unknown";
}

/** What kind of caller a name is of, where it is no user's. */
export const kindWords = ({ kind, name, method }: AuditRow) =>
  method === "CLI" ? "on the gateway's machine" : kind === "local" || (kind === "key" && name === "local") ? "key of the gateway's machine" : kind === "key" ? "key" : "";

export interface ProofWords {
  head: string;
  lines: string[];
}

const count = (many: number, one: string) => `${many.toLocaleString("en")} ${one}${many === 1 ? "" : "s"}`;

export const FAULT_WORDS: Record<AuditProof["faults"][number]["fault"], string> = {
  hash: "changed",
  missing: "missing",
  head: "cut off",
  export: "differs from what was exported",
};

/** The verification as a statement, and what it rests on. */
export function proofWords({ ok, rows, faults, heads, heads_sealed: sealed, heads_error: error }: AuditProof): ProofWords {
  const lines = [
    heads === 0
      ? "No head of the log was exported yet: that happens every hour, into the object store."
      : `Compared with ${count(heads, "exported head")}, ${sealed === heads ? (heads === 1 ? "sealed by this gateway" : "all sealed by this gateway") : `${sealed} of them sealed by this gateway`}.`,
  ];
  if (error) lines.push(`The exported heads could not be compared: ${error}.`);
  if (ok) return { head: `The log is whole: ${count(rows, "row")}, each follows from the one before.`, lines };
  if (faults.length === 0) return { head: "The log could not be verified.", lines };
  const numbers = [...new Set(faults.map(({ number }) => number))];
  const named = numbers.slice(0, 3).join(", ") + (numbers.length > 3 ? ", …" : "");
  return { head: `The log was changed after it was written: see row${numbers.length === 1 ? "" : "s"} ${named}.`, lines };
}

/** Newer rows put before those shown; without a gap, or else the newer ones alone. */
export function withNewer(shown: AuditRow[], newest: AuditRow[]): { rows: AuditRow[]; fresh: boolean } {
  const top = shown[0]?.number;
  if (top === undefined) return { rows: newest, fresh: true };
  const more = newest.filter(({ number }) => number > top);
  const joined = more.length < newest.length || newest.length === 0;
  return joined ? { rows: [...more, ...shown], fresh: false } : { rows: newest, fresh: true };
}
