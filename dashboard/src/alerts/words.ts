/** Alerts in words: severities, states, causes, what was done about them, what is silenced, checked and learned. */

import type { Alert, AlertCheck, AlertDetail, AlertRemark, AlertState, SeriesWatch, Severity, Silence } from "../api/alerts";
import { duration, short } from "../ui/format";

export const SEVERITIES: readonly Severity[] = ["error", "warning", "info"];

/** Of each severity a shape of its own, so that colour is not needed: a cross, a triangle, a ring. */
export const SHAPES: Record<Severity, string> = {
  error: "M3.800.5h4.400L11.500 3.800v4.400L8.200 11.500H3.800L.5 8.200V3.800ZM5.200 2.600v4h1.600v-4Zm0 5.200v1.600h1.600V7.800Z",
  warning: "M6 .8 11.600 11H.4ZM5.300 4.300v3.500h1.400V4.300Zm0 4.300V10h1.400V8.600Z",
  info: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1ZM5.300 5.200v3.600h1.400V5.200Zm0-2.200v1.400h1.400V3Z",
};

export const STATE_WORDS: Record<AlertState, string> = { open: "open", acknowledged: "acknowledged", resolved: "resolved" };

const CAUSES: Record<string, string> = {
  offline: "no link",
  silence: "silent topic",
  rate: "rate of a topic",
  frozen: "frozen value",
  sequence: "lost samples",
  crash: "crashing node",
  link: "unsteady link",
  battery: "battery",
  heat: "temperature",
  host: "host load",
  change: "unusual value",
  vibration: "vibration",
  together: "values that do not fit together",
  cohort: "unlike its fleet",
  too_many: "too many alerts",
};

/** A cause's word; one that says more than its group, "rate:/scan", keeps what it says. */
export function causeWords(cause: string): string {
  const [group, ...rest] = cause.split(":");
  return [CAUSES[group!] ?? group!.replaceAll("_", " "), rest.join(":")].filter(Boolean).join(" ");
}

const RANK: Record<Severity, number> = { error: 0, warning: 1, info: 2 };
export const isOver = ({ state }: Pick<Alert, "state">) => state === "resolved";
/** When it began, by the robot's clock, and when it ended: null while it goes on. */
export const beganMs = (alert: Pick<Alert, "first">) => Date.parse(alert.first);
export const endedMs = (alert: Pick<Alert, "resolved">) => (alert.resolved ? Date.parse(alert.resolved) : null);

/** What goes on before what is over, what is told before what is quiet, the worst, then the newest first. */
export function mostUrgentFirst(alerts: readonly Alert[]): Alert[] {
  const rank = (one: Alert) => (isOver(one) ? 100 : 0) + (one.quiet ? 10 : 0) + (isOver(one) ? 0 : RANK[one.severity] * 2 + Number(one.state === "acknowledged"));
  return [...alerts].sort((a, b) => rank(a) - rank(b) || Date.parse(b.opened) - Date.parse(a.opened));
}

/** The worst severity among alerts; info where there are none. */
export const worstOf = (alerts: readonly Pick<Alert, "severity">[]): Severity => SEVERITIES.find((word) => alerts.some(({ severity }) => severity === word)) ?? "info";

/** "8 min", and of what goes on "for 8 min". */
export function lastsText(alert: Pick<Alert, "first" | "resolved">, nowMs: number): string {
  const end = endedMs(alert);
  const text = duration(Math.max(1, Math.round(((end ?? nowMs) - beganMs(alert)) / 1000)));
  return end === null ? `for ${text}` : text;
}

const REMARKS: Record<string, string> = {
  opened: "It began",
  reopened: "It began again",
  escalated: "It got worse",
  acknowledged: "acknowledged it",
  unacknowledged: "took the acknowledgement back",
  assigned: "assigned it",
  comment: "wrote",
  note: "wrote",
  normal: "said that this is normal",
  resolved: "resolved it",
  silenced: "silenced it",
  clip: "asked for its clip",
};

const BY_ITSELF: Record<string, string> = { resolved: "It resolved by itself", clip: "The gateway asked for its clip" };

/** What a remark says beside its text: "ada acknowledged it", or what happened by itself. */
export function remarkWords({ by, kind }: Pick<AlertRemark, "by" | "kind">): string {
  const words = REMARKS[kind] ?? kind.replaceAll("_", " ");
  if (by) return `${by} ${words}`;
  return BY_ITSELF[kind] ?? words[0]!.toUpperCase() + words.slice(1);
}

/** Its remarks, with its beginning, and its end where nobody brought it about. */
export function historyOf({ opened, resolved, resolved_by: ender, remarks }: Pick<AlertDetail, "opened" | "resolved" | "resolved_by" | "remarks">): AlertRemark[] {
  const begun = { number: 0, at: opened, by: "", kind: "opened", text: "" };
  const told = remarks.some(({ kind, at }) => kind === "resolved" && resolved !== null && Math.abs(Date.parse(at) - Date.parse(resolved)) < 1000);
  return [begun, ...remarks, ...(resolved === null || told ? [] : [{ number: remarks.length + 1, at: resolved, by: ender, kind: "resolved", text: "" }])].sort((a, b) => Date.parse(a.at) - Date.parse(b.at));
}

/** "sim_* · battery, heat": what a silence is about. */
export function silencedWords({ robots, causes }: Pick<Silence, "robots" | "causes">): string {
  return `${robots.length > 0 ? robots.join(", ") : "every robot"} · ${causes.length > 0 ? causes.join(", ") : "every cause"}`;
}

export const UP_TO_WORDS: Record<Severity, string> = { error: "everything", warning: "warnings and below", info: "infos only" };

export const isLearning = ({ seen, of }: Pick<SeriesWatch, "seen" | "of">) => seen < of;

/** "learning, 62 of 750 samples", or "knows all 12 series". */
export function learningText(list: readonly SeriesWatch[]): string {
  const learning = list.filter(isLearning);
  if (list.length === 0) return "nothing is watched yet";
  if (learning.length === 0) return list.length === 1 ? "knows its one series" : `knows all ${list.length} series`;
  const least = learning.reduce((a, b) => (a.seen / a.of <= b.seen / b.of ? a : b));
  const samples = `${least.seen.toLocaleString("en")} of ${least.of.toLocaleString("en")} samples`;
  return learning.length === list.length ? `learning, ${samples}` : `learning ${learning.length} of ${list.length} series, ${samples}`;
}

/** The strangest first, then what is learned still, by name. */
export function strangestFirst(list: readonly SeriesWatch[]): SeriesWatch[] {
  const loud = (one: SeriesWatch) => (one.score >= 0.1 ? one.score : 0);
  return [...list].sort((a, b) => loud(b) - loud(a) || Number(isLearning(b)) - Number(isLearning(a)) || a.series.localeCompare(b.series, "en", { numeric: true }));
}

/** "above 80 °C for 10 s": when a check says something. */
export function checkWords({ low, high, unit, for_s: forS }: Pick<AlertCheck, "low" | "high" | "unit" | "for_s">): string {
  const sized = (value: number) => short(value) + (unit && `\u202f${unit}`);
  const bounds = [low === null ? "" : `below ${sized(low)}`, high === null ? "" : `above ${sized(high)}`].filter(Boolean).join(" or ");
  return [bounds, forS > 0 ? `${bounds ? "for" : "after"} ${duration(forS)}` : bounds ? "" : "at once"].filter(Boolean).join(" ");
}
