/** Typed calls for recordings, exports and the store. */

import { BASE_PATH, request, robotPath, send } from "./client";
import { rfc3339 } from "./history";
import type { Recording, StoreView } from "./history_types";

const path = (id: string) => `/recordings/${encodeURIComponent(id)}`;

export const recordingsApi = {
  list: async (robot = "", limit = 200) => {
    const query = new URLSearchParams([...(robot ? [["robot", robot]] : []), ["limit", String(limit)]]);
    return (await request<{ recordings: Recording[] }>(`/recordings?${query}`)).recordings;
  },
  saveLast: (robot: string, lastS: number) => send<Recording>("POST", `${robotPath(robot)}/recordings`, { last_s: lastS }),
  save: (robot: string, startMs: number, endMs: number) =>
    send<Recording>("POST", `${robotPath(robot)}/recordings`, { start: rfc3339(startMs), end: rfc3339(endMs) }),
  remove: (id: string) => send<null>("DELETE", path(id)),
  store: () => request<StoreView>("/store"),
  fileHref: (id: string) => `${BASE_PATH}${path(id)}/file.mcap`,
};

/** Where a browser downloads stored messages of robots as one MCAP file. */
export function exportHref(robots: string[], topics: string[], startMs: number, endMs: number): string {
  const query = new URLSearchParams([
    ...robots.map((robot) => ["robot", robot]),
    ...topics.map((topic) => ["topic", topic]),
    ["start", rfc3339(startMs)],
    ["end", rfc3339(endMs)],
  ]);
  return `${BASE_PATH}/export.mcap?${query}`;
}
