/** Typed calls for recordings, exports and the store. */

import { BASE_PATH, request, robotPath, send } from "./client";
import { rfc3339 } from "./history";
import type { AnswerOf, BodyOf } from "./operation.js";

type Save = "POST /robots/{robot_id}/recordings";

const path = (id: string) => `/recordings/${encodeURIComponent(id)}`;
const save = (robot: string, body: BodyOf<Save>) => send<AnswerOf<Save>>("POST", `${robotPath(robot)}/recordings`, body); // the live page saves: it does without call.ts

export const recordingsApi = {
  list: async (robot = "", limit = 200) => {
    const query = new URLSearchParams([...(robot ? [["robot", robot]] : []), ["limit", String(limit)]]);
    return (await request<AnswerOf<"GET /recordings">>(`/recordings?${query}`)).recordings;
  },
  saveLast: (robot: string, lastS: number) => save(robot, { last_s: lastS }),
  save: (robot: string, startMs: number, endMs: number) => save(robot, { start: rfc3339(startMs), end: rfc3339(endMs) }),
  remove: (id: string) => send<AnswerOf<"DELETE /recordings/{recording_id}">>("DELETE", path(id)),
  store: () => request<AnswerOf<"GET /store">>("/store"),
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
