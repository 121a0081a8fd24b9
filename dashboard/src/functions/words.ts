/** What the pages of functions say in words: durations, triggers, states, canaries. */

import type { Tone } from "../admin/badge";
import type { Canary, FunctionRow, Invocation, Stats, Trigger } from "../api/functions";
import { duration, NONE, percent } from "../ui/format";

export const LATEST = "$LATEST";
export const WINDOWS: Record<string, number> = { "15m": 900, "1h": 3600, "3h": 10_800 };
export const USUAL_WINDOW = "1h";

export const functionHref = (name: string, tab = "") => `/functions/${encodeURIComponent(name)}${tab && `?tab=${tab}`}`;

/** "0.42 ms", "83 ms", "4.1 s": about three digits. */
export function milliseconds(ms: number | null | undefined): string {
  if (ms == null || !Number.isFinite(ms)) return NONE;
  if (ms >= 999.5) return duration(Number((ms / 1000).toPrecision(3)));
  return `${ms >= 99.5 ? Math.round(ms) : Number(ms.toPrecision(ms < 1 ? 2 : 3))}\u202fms`;
}

/** A share of errors that is there but small is not 0 %. */
export function errorShare({ errors, invocations }: Pick<Stats, "errors" | "invocations">): string {
  if (errors === 0 || invocations === 0) return "";
  const share = errors / invocations;
  return share < 0.01 ? `< 1\u202f%` : percent(share);
}

const TRIGGERS: Record<Trigger["kind"], string> = { rule: "rule", schedule: "schedule", mapping: "topic" };

/** An event source mapping's ARN says which topic of which robots; the rest is in its title already. */
export function triggerWords({ kind, title }: Pick<Trigger, "kind" | "title">): string {
  const topic = kind === "mapping" ? topicOf(title) : null;
  if (topic) return topic.robots === "*" ? topic.topic : `${topic.topic} of ${topic.robots}`;
  return title;
}

export const triggerKind = (kind: Trigger["kind"]) => TRIGGERS[kind];

export function topicOf(arn: string): { robots: string; topic: string } | null {
  const found = /^arn:aws:metaros:[^:]*:[^:]*:topic\/([^/]+)\/(.+)$/.exec(arn);
  return found ? { robots: found[1]!, topic: `/${found[2]!.replace(/^\//, "")}` } : null;
}

export function stateTone(state: string): Tone {
  return state === "Active" ? "good" : state === "Failed" ? "bad" : state === "Pending" ? "warn" : "off";
}
export const stateWord = (state: string) => state.toLowerCase();

export const STATUS_TONES: Record<Invocation["status"], Tone> = { ok: "good", error: "bad", timeout: "bad", throttled: "warn" };
export const KIND_WORDS: Record<Invocation["kind"], string> = { request: "call", event: "event", mapping: "batch", test: "test", robot: "on the robot" };

export const CANARY_WORDS: Record<Canary["state"], string> = { running: "canary runs", promoted: "promoted", rolled_back: "rolled back", cancelled: "stopped" };
export const CANARY_TONES: Record<Canary["state"], Tone> = { running: "warn", promoted: "good", rolled_back: "bad", cancelled: "off" };

/** How a canary does, in a sentence. */
export function canaryText(canary: Canary): string {
  const { version, stable, weight, invocations, errors, reason } = canary;
  const seen = `${errors} of ${invocations} calls failed`;
  if (canary.state === "running") return `Version ${version} gets ${percent(weight)}, version ${stable} the rest: ${seen} so far.`;
  if (canary.state === "promoted") return `Version ${version} gets every call: ${seen}.`;
  const back = `Version ${stable} gets every call again`;
  return reason ? `${back}: ${reason}` : `${back}.`;
}

/** What comes to every version of an alias, the main one first: shares add up to 1. */
export function sharesOf(version: string, weights: Record<string, number>): [string, number][] {
  const others = Object.entries(weights).filter(([, share]) => share > 0);
  const rest = 1 - others.reduce((sum, [, share]) => sum + share, 0);
  return [[version, rest], ...others];
}

/** Those that need somebody first: failing ones, then those that are called most. */
export function worstFirst(rows: FunctionRow[]): FunctionRow[] {
  const rank = (row: FunctionRow) => (row.state === "Failed" ? 2 : row.stats.dead_letters + row.stats.errors > 0 ? 1 : 0);
  return [...rows].sort((a, b) => rank(b) - rank(a) || b.stats.errors - a.stats.errors || b.stats.invocations - a.stats.invocations || a.name.localeCompare(b.name));
}

/** Each word is somewhere in the function's name, description or triggers. */
export function lets(row: FunctionRow, text: string): boolean {
  const said = [row.name, row.description, row.handler, ...row.triggers.map(triggerWords)].join(" ").toLowerCase();
  return text.toLowerCase().split(/\s+/).every((word) => said.includes(word));
}
