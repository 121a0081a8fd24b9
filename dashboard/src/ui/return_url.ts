/** The URL to return to after signing in, here or at an identity provider. */

import { BACK_KEY, here, replace, setParam } from "./url";

/** Where signing in leads back to: an address of a page of ours, else the fleet. */
export function returnUrlFrom(text: string | null): string {
  const url = text?.startsWith("/") ? new URL(text, location.origin) : null;
  if (!url || url.origin !== location.origin || /^\/(signin|api)(\/|$)/.test(url.pathname)) return "/";
  return url.pathname + url.search;
}

const BACK_MS = 600_000;

/** Remember where to come back to from another site, which sends the browser to "/". */
export function leaveFor(back: string): void {
  sessionStorage.setItem(BACK_KEY, JSON.stringify([Date.now(), back]));
}

export function returnFromSignIn(): void {
  const kept = sessionStorage.getItem(BACK_KEY);
  sessionStorage.removeItem(BACK_KEY);
  const refused = location.pathname === "/signin"; // there, and led here: the next try leads back all the same
  if (!kept || (!refused && here() !== "/")) return;
  try {
    const [leftMs, back] = JSON.parse(kept) as [number, string];
    if (Date.now() - leftMs >= BACK_MS) return;
    if (refused) setParam("back", returnUrlFrom(back), "/");
    else replace(returnUrlFrom(back));
  } catch {
    // somebody else wrote it
  }
}
