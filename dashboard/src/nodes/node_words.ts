/** Nodes in words: what a state means, what may be done in it, and what a node runs. */

import type { Tone } from "../admin/badge";
import type { Node, NodeResult, NodeVerb } from "../api/nodes";

const TONES: Record<string, Tone> = {
  running: "good",
  starting: "warn",
  backoff: "warn",
  waiting: "warn",
  blocked: "warn",
  fetching: "warn",
  hung: "bad",
  quarantined: "bad",
  refused: "bad",
  stopped: "off",
  ended: "off",
  unknown: "off",
};

/** The tone of what is shown; what a robot that is away said last is no more than that. */
export function toneOf({ state, online, in_step, wanted }: Node): Tone {
  if (!online) return "off";
  const tone = Object.hasOwn(TONES, state) ? TONES[state]! : "warn"; // a word of a later version
  return tone === "off" && !in_step && wanted === "running" ? "warn" : tone;
}

/** What a node runs, shortly. */
export function programOf({ desired }: Node): string {
  if (!desired) return "not in the twin";
  if (desired.bundle) return `${desired.bundle} ${desired.version}`;
  if (desired.allowed) return `allow-list: ${desired.allowed}`;
  return desired.command.join(" ");
}

/** Why it is not as desired, each reason once; else why it is as it is. */
export function reasonsOf({ differs, reported, state, wanted }: Node): string[] {
  const said = differs.map(({ why }) => why).filter(Boolean);
  if (said.length === 0 && reported && state !== "running" && !(state === "stopped" && wanted === "stopped")) said.push(reported.why || reported.last_exit);
  const update = reported?.update;
  if (update && !["healthy", "idle"].includes(update.state) && !differs.some(({ what }) => what === "version")) {
    said.push(`version ${update.version}: ${update.state.replaceAll("_", " ")}${update.message ? `, ${update.message}` : ""}`);
  }
  if (reported?.safe_stop) said.push(`safe stop of the robot: ${reported.safe_stop}`);
  return [...new Set(said.filter(Boolean))];
}

/** The verbs that make sense now, in the order of their buttons. */
export function verbsOf(node: Node): NodeVerb[] {
  const { state, online, desired, wanted, reported } = node;
  const verbs: NodeVerb[] = [];
  const runs = desired?.run ?? false;
  const waits = wanted === "standby" || reported?.why === "no lease"; // started already, as far as people can
  const idle = state === "stopped" || state === "ended";
  if (desired && (!runs || (idle && !waits))) verbs.push("start");
  if (desired && (runs ? !idle || waits : state === "running")) verbs.push("stop");
  if (online && ["running", "hung", "starting"].includes(state)) verbs.push("restart");
  if (online && ["quarantined", "backoff", "refused", "ended"].includes(state)) verbs.push("retry");
  return verbs;
}

export const VERB_WORDS: Record<NodeVerb, string> = { start: "Start", stop: "Stop", restart: "Restart", retry: "Try again", signal: "Send" };
const DONE: Record<NodeVerb, string> = { start: "was started", stop: "was stopped", restart: "was restarted", retry: "is tried again", signal: "got the signal" };

/** What became of a verb. */
export function resultWords({ node, verb, outcome, message }: NodeResult): string {
  if (outcome === "done") return `${node} ${DONE[verb]}.`;
  if (outcome === "pending") return `The robot ${verb === "stop" ? "stops" : "starts"} ${node} when it is back${message ? `: ${message}` : ""}.`;
  return message || `${node}: ${verb} failed.`;
}

export const SIGNALS: readonly [string, number][] = [["HUP", 1], ["INT", 2], ["USR1", 10], ["USR2", 12], ["TERM", 15], ["KILL", 9]];

/** Lines that say by themselves how bad they are. */
export function levelOf(text: string): "error" | "warn" | "" {
  if (/\b(ERROR|FATAL|CRITICAL|Traceback)\b/.test(text)) return "error";
  return /\bWARN(ING)?\b/.test(text) ? "warn" : "";
}

/** A text cut where a search was found in it, whatever its case: what is found stands at odd places. */
export function cut(text: string, query: string): string[] {
  if (query === "") return [text];
  const parts: string[] = [];
  const [where, what] = [text.toLowerCase(), query.toLowerCase()];
  if (where.length !== text.length) return [text]; // a letter whose small one is longer: places would be wrong
  let from = 0;
  for (let i = where.indexOf(what); i >= 0; i = where.indexOf(what, from)) {
    parts.push(text.slice(from, i), text.slice(i, i + what.length));
    from = i + what.length;
  }
  return [...parts, text.slice(from)];
}
