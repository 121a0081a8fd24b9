/** Rollouts in words and numbers: states, waves, which robots need somebody. */

import type { Tone } from "../admin/badge";
import type { Bundle, Member, MemberState, Rollout, RolloutState, Wave } from "../api/rollouts";
import type { Template } from "../api/templates";
import { isObject } from "../values/json";

export const STATE_TONES: Record<RolloutState, Tone> = { running: "good", paused: "warn", halted: "bad", done: "good", aborted: "off" };
export const STATE_WORDS: Record<RolloutState, string> = {
  running: "running",
  paused: "paused",
  halted: "halted by itself",
  done: "done",
  aborted: "ended",
};

export const isOpen = ({ state }: Pick<Rollout, "state">) => state === "running" || state === "paused" || state === "halted";

/** "agent 2.1.0", or "lidar 1.2.0". */
export const thingOf = ({ kind, node, version }: Pick<Rollout, "kind" | "node" | "version">) => `${kind === "agent" ? "agent" : node} ${version}`;

export const robotsText = (count: number) => `${count.toLocaleString("en")} ${count === 1 ? "robot" : "robots"}`;

export interface Part {
  name: "done" | "flight" | "failed" | "waiting";
  word: string;
  count: number;
}

/** What a bar of a wave is made of; places that nobody took are among those that wait. */
export function partsOf({ size, in_flight: flight, done, failed }: Wave): Part[] {
  return [
    { name: "done", word: "done", count: done },
    { name: "flight", word: "in flight", count: flight },
    { name: "failed", word: "failed", count: failed },
    { name: "waiting", word: "waiting", count: Math.max(0, size - flight - done - failed) },
  ];
}

/** "3 done, 1 failed, 6 waiting". */
export const partsText = (parts: Part[]) => parts.filter(({ count }) => count > 0).map(({ count, word }) => `${count} ${word}`).join(", ") || "nobody";

/** How much of a rollout has settled, 0 to 1. */
export function settled({ counts, robots }: Pick<Rollout, "counts" | "robots">): number {
  return robots === 0 ? 0 : (counts.done + counts.failed + counts.unreached) / robots;
}

/** How many of a wave may fail before the rollout halts: the gateway counts so. */
export const allowedOf = (rate: number, size: number) => Math.floor(rate * size + 1e-9);

export const MEMBER_WORDS: Record<MemberState, string> = {
  failed: "failed",
  updating: "updating",
  starting: "being notified",
  waiting: "waiting",
  unreached: "left out",
  done: "done",
};
export const MEMBER_TONES: Record<MemberState, Tone> = { failed: "bad", updating: "warn", starting: "warn", waiting: "off", unreached: "off", done: "good" };
const RANKS = Object.keys(MEMBER_WORDS);

/** Failed ones first, then those at it; within a state in the order of their turns. */
export function worstFirst(members: Member[]): Member[] {
  return members
    .map((member, place) => ({ member, place }))
    .sort((a, b) => RANKS.indexOf(a.member.state) - RANKS.indexOf(b.member.state) || a.place - b.place)
    .map(({ member }) => member);
}

/** Those of a state whose name or reason holds a text; "" is any. */
export const foundAmong = (members: Member[], state: string, text: string) =>
  members.filter((one) => (state === "" || one.state === state) && `${one.robot} ${one.reason}`.toLowerCase().includes(text.toLowerCase()));

/** Whether robots can be given it. */
export const isReady = ({ signed, withdrawn }: Bundle) => signed && withdrawn === null;

/** Newest version first: by its numbers, as 1.10 is newer than 1.9. */
export const newestFirst = (bundles: Bundle[]) =>
  [...bundles].sort((a, b) => a.name.localeCompare(b.name) || b.version.localeCompare(a.version, "en", { numeric: true }));

/** "1, 10%, 100%" as the gateway takes it. */
export const wavesOf = (text: string) => text.split(/[\s,;]+/).filter(Boolean);

/** Carefulness that people choose from. */
export const CARE: readonly [string, string][] = [
  ["Careful", "1, 10%, 50%, 100%"],
  ["Half first", "50%, 100%"],
  ["All at once", "100%"],
];

/** A selector with one more term, or without it where it had it. */
export function withTerm(selector: string, term: string): string {
  const terms = selector.split(",").map((part) => part.trim()).filter(Boolean);
  return (terms.includes(term) ? terms.filter((one) => one !== term) : [...terms, term]).join(", ");
}

export interface Label {
  term: string;
  robots: number;
}

/** The labels that robots have, the most frequent first. */
export function labelsOf(robots: { labels: Record<string, string> }[], most: number): Label[] {
  const found = new Map<string, number>();
  for (const { labels } of robots) {
    for (const [name, value] of Object.entries(labels)) found.set(`${name}=${value}`, (found.get(`${name}=${value}`) ?? 0) + 1);
  }
  return [...found].map(([term, count]) => ({ term, robots: count })).sort((a, b) => b.robots - a.robots || a.term.localeCompare(b.term)).slice(0, most);
}

/** The nodes that templates run from a bundle. */
export function nodesOf(templates: Pick<Template, "document">[], bundle: string): string[] {
  const found = templates.flatMap(({ document: { nodes } }) =>
    isObject(nodes) ? Object.keys(nodes).filter((name) => isObject(nodes[name]) && nodes[name].bundle === bundle) : [],
  );
  return [...new Set(found)].sort();
}
