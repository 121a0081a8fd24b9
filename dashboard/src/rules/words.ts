/** What a rule says, in words: what it listens to, what has to hold, what it does then. */

import type { Document, Rule } from "../api/rules";
import { Exact, isObject, writeJson, type Json, type JsonObject } from "../values/json";

export type Source = "pattern" | "topic" | "metric" | "schedule";
export const SOURCES: readonly (readonly [Source, string])[] = [["pattern", "event"], ["topic", "topic"], ["metric", "number"], ["schedule", "schedule"]];

export const ruleHref = (name: string, tab = "") => `/rules/${encodeURIComponent(name)}${tab && `?tab=${tab}`}`;
export const sourceOf = (document: Document): Source => (["topic", "metric", "schedule"] as const).find((name) => document[name] != null) ?? "pattern";

const listed = (items: string[]) => (items.length < 2 ? (items[0] ?? "") : `${items.slice(0, -1).join(", ")} or ${items.at(-1)}`);
const texts = (value: Json | undefined): string[] => (Array.isArray(value) ? value.map(short) : value === undefined || value === null ? [] : [short(value)]);

/** A value, or one of EventBridge's tests, as short as it can be said. */
function short(value: Json): string {
  if (typeof value === "string") return value.replace(/^metaros\./, "");
  if (value instanceof Exact || !isObject(value)) return writeJson(value);
  const [test, wanted] = Object.entries(value)[0] ?? ["", null];
  if (test === "prefix") return `${short(wanted)}…`;
  if (test === "wildcard") return short(wanted);
  if (test === "exists") return wanted === false ? "absent" : "there";
  if (test === "anything-but") return `not ${listed(isObject(wanted) ? [short(wanted)] : texts(wanted))}`;
  if (test === "numeric" && Array.isArray(wanted)) return wanted.map((item) => String(item)).join(" ");
  return `${test} ${short(wanted)}`;
}

const ofRobots = (source: JsonObject): string => {
  const robots = texts(source.robots);
  return robots.length === 0 || robots.includes("*") ? "" : ` of ${listed(robots)}`;
};

/** "alert.opened", "/battery_state of sim_*", "cpu.percent above 90", "cron(0 3 * * ? *) in Europe/Paris". */
export function sourceWords(document: Document): string {
  const { topic, metric, schedule, pattern } = document;
  if (isObject(schedule)) return `${texts(schedule.expression)[0] ?? "?"}${schedule.timezone && schedule.timezone !== "UTC" ? ` in ${String(schedule.timezone)}` : ""}`;
  if (isObject(topic)) return `${texts(topic.topic)[0] ?? "?"}${ofRobots(topic)}`;
  if (isObject(metric)) {
    const bounds = (["above", "below"] as const).filter((word) => metric[word] != null).map((word) => `${word} ${String(metric[word])}`);
    return [`${texts(metric.series)[0] ?? "?"}${ofRobots(metric)}`, listed(bounds)].filter(Boolean).join(" ");
  }
  if (!isObject(pattern)) return "nothing yet";
  return listed(texts(pattern["detail-type"])) || listed(texts(pattern.source).map((source) => `anything from ${source}`)) || "anything that fits";
}

/** What a pattern asks for besides the type: "severity error", "robot sim_*". */
export function filterWords({ pattern }: Document): string[] {
  if (!isObject(pattern)) return [];
  const said: string[] = [];
  const walk = (value: JsonObject, path: string) => {
    for (const [key, item] of Object.entries(value)) {
      if (!path && ["detail-type", "source"].includes(key)) continue;
      const name = path ? `${path}.${key}` : key;
      if (isObject(item)) walk(item, name);
      else if (!key.startsWith("$")) said.push(`${name.replace(/^detail\./, "")} ${listed(texts(item))}`);
    }
  };
  walk(pattern, "");
  return said;
}

const WHEN: [string, (value: Json) => string][] = [
  ["absent_for", (value) => `absent for ${short(value)}`],
  ["for", (value) => `for ${short(value)}`],
  ["rate", (value) => (isObject(value) ? `${String(value.count)} times within ${short(value.within ?? "?")}` : short(value))],
  ["debounce", (value) => `once quiet for ${isObject(value) ? short(value.quiet ?? "?") : short(value)}`],
  ["hysteresis", (value) => (isObject(value) ? `from ${String(value.enter)} until ${String(value.exit)}` : short(value))],
  ["edge", (value) => (value === "both" ? "when it begins and ends" : value === "falling" ? "when it ends" : "when it begins")],
  ["cooldown", (value) => `then quiet for ${short(value)}`],
];

export const whenWords = ({ when }: Document): string[] => (isObject(when) ? WHEN.filter(([key]) => when[key] != null).map(([key, words]) => words(when[key]!)) : []);

/** "calls dock_when_low", "asks https://hooks…", "sends dock to the robot". */
export function targetWords(target: Json): string {
  if (!isObject(target)) return "?";
  const text = (key: string) => (target[key] == null ? "" : String(target[key]));
  const whose = text("robot") || "the robot";
  const AWS: Record<string, string> = { lambda: text("function"), sns: text("topic_arn"), sqs: text("queue_url"), events: text("bus"), s3: text("bucket") };
  const words: Record<string, string> = {
    function: `calls ${text("function")}${text("qualifier") && `:${text("qualifier")}`}`,
    webhook: `asks ${host(text("url"))}`,
    command: `sends ${text("command")} to ${whose}`,
    publish: `publishes ${text("topic")} on ${whose}`,
    capture: `keeps the last ${text("last_s")} s of ${whose}`,
    alert: `raises ${text("severity") === "info" || text("severity") === "error" ? "an" : "a"} ${text("severity") || "warning"}`,
    aws: `hands it to AWS ${text("service")} ${AWS[text("service")] ?? ""}`.trim(),
  };
  return words[text("kind")] ?? text("kind");
}

function host(url: string): string {
  try {
    return new URL(url).host;
  } catch {
    return url;
  }
}

/** Those with trouble first, then those that fire, then by name; what is off is last. */
export const worstFirst = (rows: Rule[]): Rule[] =>
  [...rows].sort((a, b) => Number(b.enabled ?? true) - Number(a.enabled ?? true) || Number(b.stats.errors > 0) - Number(a.stats.errors > 0) || b.stats.fired - a.stats.fired || a.name.localeCompare(b.name));

export function lets(rule: Rule, text: string): boolean {
  const said = [rule.name, rule.description, sourceWords(rule), ...filterWords(rule), ...(rule.targets ?? []).map(targetWords)].join(" ").toLowerCase();
  return text.toLowerCase().split(/\s+/).every((word) => said.includes(word));
}
