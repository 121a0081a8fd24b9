/** The page's state is its address: a path, and parameters that views read and set. */

import { signal } from "@preact/signals";

export interface Place {
  path: string;
  params: URLSearchParams;
}

const read = (): Place => ({ path: location.pathname, params: new URLSearchParams(location.search) });

export const place = signal<Place>(read());

export function startRouting(): void {
  addEventListener("popstate", () => {
    place.value = read();
  });
}

export function go(href: string): void {
  history.pushState(null, "", href);
  place.value = read();
  scrollTo(0, 0);
}

/** Show another page in the place of this one: "back" does not lead here again. */
export function replace(href: string): void {
  history.replaceState(null, "", href);
  place.value = read();
}

/** The page's own address, without its origin and fragment. */
export const here = () => location.pathname + location.search;

/** Something was left in this browser's session: where to come back to, see back.ts. */
export const BACK_KEY = "metaros.back";

/** Set one parameter of this page; an empty value or the default removes it. */
export function setParam(name: string, value: string, fallback = ""): void {
  const params = new URLSearchParams(location.search);
  if (value === fallback) params.delete(name);
  else params.set(name, value);
  const query = params.toString().replaceAll("%3A", ":"); // a time stays readable
  history.replaceState(null, "", location.pathname + (query ? `?${query}` : ""));
  place.value = read();
}

export const robotHref = (id: string) => `/robots/${encodeURIComponent(id)}`;

/** The robot id in a path, or null for any other path. */
export function robotOf(path: string): string | null {
  const match = /^\/robots\/([^/]+)\/?$/.exec(path);
  try {
    return match ? decodeURIComponent(match[1]!) : null;
  } catch {
    return null;
  }
}
