/** Moments of rules: how far away they are, and what a clock in another time zone shows then. */

import { clockTime, dayText, duration } from "../ui/format";

/** "in 4 min", "now" where it is due. */
export function inText(iso: string, nowMs: number): string {
  const seconds = Math.round((Date.parse(iso) - nowMs) / 1000);
  return seconds <= 0 ? "now" : `in ${duration(seconds)}`;
}

export const momentText = (iso: string) => `${dayText(Date.parse(iso))} ${clockTime(Date.parse(iso))}`;

/** "Mon 23 Nov, 03:00" as it is in that zone; a zone that the browser does not know is UTC, and says so. */
export function inZone(iso: string, timeZone: string): string {
  const options = { weekday: "short", day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" } as const;
  try {
    return new Intl.DateTimeFormat("en-GB", { ...options, timeZone }).format(Date.parse(iso));
  } catch {
    return `${new Intl.DateTimeFormat("en-GB", { ...options, timeZone: "UTC" }).format(Date.parse(iso))} UTC`;
  }
}

/** The spans that a dry run looks back over, as the gateway reads them. */
export const BACK: readonly (readonly [string, string, number])[] = [["-1h", "1 hour", 3_600_000], ["-6h", "6 hours", 21_600_000], ["-24h", "a day", 86_400_000], ["-7d", "a week", 604_800_000]];

/** Firings in lanes, by robot; the place of each from 0 to 1. Lanes with most firings first, the rest in one. */
export function lanesOf<T extends { at: string; robot: string }>(firings: readonly T[], startMs: number, endMs: number, most: number): { name: string; marks: { at: number; firing: T }[] }[] {
  const byRobot = new Map<string, T[]>();
  for (const firing of firings) byRobot.set(firing.robot, [...(byRobot.get(firing.robot) ?? []), firing]);
  const sorted = [...byRobot].sort(([a, one], [b, other]) => other.length - one.length || a.localeCompare(b));
  const shown = sorted.length > most ? [...sorted.slice(0, most - 1), [`${sorted.length - most + 1} more robots`, sorted.slice(most - 1).flatMap(([, rows]) => rows)] as const] : sorted;
  const at = (firing: T) => Math.min(1, Math.max(0, (Date.parse(firing.at) - startMs) / (endMs - startMs)));
  return shown.map(([name, rows]) => ({ name, marks: rows.map((firing) => ({ at: at(firing), firing })) }));
}
