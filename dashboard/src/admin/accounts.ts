/** Roles, patterns of robots and the lives of keys, in words. */

import type { ApiKey, RoleWord, User } from "../api/admin";
import { ageText } from "../live/age";
import { duration } from "../ui/format";

export const ROLES: readonly RoleWord[] = ["viewer", "operator", "admin"];

export const ROLE_WORDS: Record<RoleWord, string> = {
  viewer: "looks at robots, their past and recordings",
  operator: "also drives robots, calls services, saves and deletes recordings",
  admin: "also looks after users, keys, robots' identities and this log",
};

/** The roles that somebody may give away: none above their own. */
export const rolesUpTo = (role: string) => ROLES.slice(0, ROLES.indexOf(role as RoleWord) + 1);

/** What somebody typed as patterns; nothing means every robot. */
export function patternsOf(text: string): string[] {
  const found = [...new Set(text.split(/[\s,;]+/).filter(Boolean))];
  return found.length > 0 ? found : ["*"];
}

export const robotsWords = (robots: string[]) =>
  robots.includes("*") ? "every robot" : robots.length === 0 ? "no robot" : robots.join(", ");

/** How a user gets in. */
export function waysIn({ external, has_password: password }: User): string {
  if (external) return "single sign-on";
  return password ? "password" : "sign-in link";
}

/** "3 min ago", or `never`. */
export const agoText = (stamp: string | null, nowMs: number, never = "never") =>
  stamp === null ? never : `${ageText(nowMs - Date.parse(stamp))} ago`;

export interface KeyLife {
  over: boolean;
  soon: boolean;
  text: string;
}

const SOON_MS = 7 * 86_400_000;

export function keyLife({ expires }: ApiKey, nowMs: number): KeyLife {
  if (expires === null) return { over: false, soon: false, text: "never" };
  const leftMs = Date.parse(expires) - nowMs;
  if (leftMs <= 0) return { over: true, soon: false, text: `expired ${duration(-leftMs / 1000)} ago` };
  return { over: false, soon: leftMs < SOON_MS, text: `in ${duration(leftMs / 1000)}` };
}

/** Lives that the form of a new key offers. */
export const KEY_LIVES: readonly [string, number | null][] = [
  ["1 day", 86_400],
  ["30 days", 30 * 86_400],
  ["90 days", 90 * 86_400],
  ["1 year", 365 * 86_400],
  ["never", null],
];

/** Why a name cannot be a user's, or "". The gateway says the same. */
export function userNameProblem(name: string): string {
  if (/^[a-z0-9][a-z0-9._@+-]{0,63}$/.test(name)) return "";
  return name === "" ? "Give a name." : "Lower-case letters, digits and . _ @ + -, beginning with a letter or digit.";
}
