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
