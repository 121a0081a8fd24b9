/** Who uses this page and what they may do: one signal, which every view reads and the gateway alone decides. */

import { computed, signal } from "@preact/signals";
import type { Account } from "./schema.js";

export type { Account };
export type Role = Account["role"];

export const NOBODY: Account = {
  kind: "anonymous",
  id: "",
  name: "anonymous",
  role: "none",
  robots: [],
  scopes: [],
  csrf: "",
  has_password: false,
  permissions: [],
};

/** Null: not asked yet. Nobody known: role "none". */
export const session = signal<Account | null>(null);
/** The name of whom the gateway does not know any more; "" when nobody had signed in. */
export const ended = signal("");
/** The browser holds a session that is not good any more, and goes on sending it. */
export const stale = signal(false);
/** Nothing can be shown before somebody signs in. */
export const shutOut = computed(() => session.value?.role === "none");
export const signedIn = computed(() => session.value !== null && session.value.kind !== "anonymous");

let generation = 0;
let asking: Promise<void> | null = null;

/** Whether the person may: `can("robots.drive")`, a name of the gateway's permission table. */
export const can = (permission: string): boolean => session.value?.permissions.includes(permission) ?? false;

/** From now on this account uses the page; an answer to an older question does not count any more. */
export function become(account: Account): void {
  generation += 1;
  asking = null;
  const before = session.peek();
  if (account.role !== "none") {
    ended.value = "";
    stale.value = false;
  } else if (before?.kind === "user") ended.value = before.name;
  session.value = account;
}

/** Ask the gateway who uses the page. What cannot be answered changes nothing. */
export function refresh(): Promise<void> {
  asking ??= ask(generation).finally(() => (asking = null));
  return asking;
}

async function ask(asked: number): Promise<void> {
  let found: Account | null = null;
  try {
    const answer = await fetch("/api/v1/auth/me", { cache: "no-store" });
    if (answer.ok) found = (await answer.json()) as Account;
    else if (answer.status === 401) {
      found = NOBODY;
      const problem = (await answer.json().catch(() => null)) as { code?: string } | null;
      if (asked === generation) stale.value = problem?.code === "bad_credentials";
    }
  } catch {
    // the gateway does not answer; the stream says so
  }
  if (found && asked === generation) become(found);
}

/** Why something is not offered: "Operators may drive." `least` are those who may. */
export function whyNot(what: string, least: "Operators" | "Admins" = "Operators"): string {
  const who = session.value;
  if (!who || who.kind === "anonymous") return `${least} may ${what}.`;
  return `${least} may ${what}; ${who.name} is ${who.role === "viewer" ? "a" : "an"} ${who.role}.`;
}
