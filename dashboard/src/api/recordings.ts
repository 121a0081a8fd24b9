/** Typed calls for recordings, exports and the store. */

import { BASE_PATH, call } from "./client";
import { rfc3339 } from "./history";

const path = (id: string) => `/recordings/${encodeURIComponent(id)}`;

export const recordingsApi = {
  list: async (robot = "", limit = 200) => (await call("GET /recordings", { query: { robot: robot || undefined, limit } })).recordings,
  saveLast: (robot: string, lastS: number) => call("POST /robots/{robot_id}/recordings", { path: { robot_id: robot }, body: { last_s: lastS } }),
  save: (robot: string, startMs: number, endMs: number) =>
    call("POST /robots/{robot_id}/recordings", { path: { robot_id: robot }, body: { start: rfc3339(startMs), end: rfc3339(endMs) } }),
  remove: (id: string) => call("DELETE /recordings/{recording_id}", { path: { recording_id: id } }),
  store: () => call("GET /store"),
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
