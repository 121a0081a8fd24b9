/** Rows of the audit log as sentences, and what their answers mean. */

import type { AuditProof, AuditRow } from "../api/admin";

/** What a path means, as something to do; a part of the path in brackets takes the place of `*`. The first that fits counts. */
const ACTS: [string, RegExp, string][] = [
  ["POST", /^\/auth\/login$/, "sign in with a password"],
  ["POST", /^\/auth\/link$/, "sign in by a link"],
  ["GET", /^\/auth\/oidc\//, "sign in by single sign-on"],
  ["POST", /^\/auth\/links$/, "make a sign-in link"],
  ["POST", /^\/auth\/logout$/, "sign out"],
  ["POST", /^\/auth\/password$/, "change the own password"],
  ["POST", /^\/users$/, "add a user"],
  ["PATCH", /^\/users\/([^/]+)$/, "change user *"],
  ["DELETE", /^\/users\/([^/]+)$/, "delete user *"],
  ["POST", /^\/keys$/, "make a key"],
  ["DELETE", /^\/keys\/([^/]+)$/, "revoke key *"],
  ["POST", /^\/enrolment-tokens$/, "make an enrolment command"],
  ["DELETE", /^\/enrolment-tokens\/([^/]+)$/, "withdraw enrolment command *"],
  ["POST", /^\/enrol$/, "take a first certificate"],
  ["POST", /^\/enrol\/challenge$/, "begin to renew a certificate"],
  ["POST", /^\/enrol\/renew$/, "renew a certificate"],
  ["POST", /^\/robots\/([^/]+)\/revoke$/, "revoke the identity of *"],
  ["PUT", /^\/robots\/([^/]+)\/uplink$/, "set the byte budget of *"],
  ["POST", /^\/robots\/([^/]+)\/services\/call$/, "call a service of *"],
  ["POST", /^\/robots\/([^/]+)\/publish$/, "publish on *"],
  ["POST", /^\/robots\/([^/]+)\/recordings$/, "save a recording of *"],
  ["DELETE", /^\/recordings\/([^/]+)$/, "delete recording *"],
  ["SOCKET", /^\/robots\/([^/]+)\/teleop$/, "take the controls of *"],
  ["SOCKET", /^\/link$/, "open a robot's link"],
];

const PAST: Record<string, string> = {
  add: "added", begin: "began", call: "called", change: "changed", delete: "deleted", make: "made", open: "opened", publish: "published",
  renew: "renewed", revoke: "revoked", save: "saved", set: "set", sign: "signed", take: "took", withdraw: "withdrew",
};

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** What a row is about, without who: "made a key", or "tried to make a key" where that was refused. */
export function actWords(row: AuditRow): string {
  const { method, target, action } = row;
  if (method === "CLI") return target;
  const path = target.replace(/^\/api\/v\d+/, "");
  const done = outcomeOf(row) === "done";
  for (const [wanted, pattern, act] of ACTS) {
    const match = wanted === method ? pattern.exec(path) : null;
    if (!match) continue;
    const whole = act.replace("*", () => decoded(match[1] ?? ""));
    return done ? whole.replace(/^\w+/, (verb) => PAST[verb] ?? verb) : `tried to ${whole}`;
  }
  return [method, target].filter(Boolean).join(" ") || action;
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
