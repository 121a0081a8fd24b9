/** Typed calls for what is stored: a robot's history. Times go in as milliseconds since the epoch. */

import { request, requestBytes, robotPath } from "./client";
import type { Density, Ranged, Stored, StoredMessage } from "./history_types";

/** RFC 3339 in UTC, without milliseconds where there are none. */
export const rfc3339 = (ms: number) => new Date(ms).toISOString().replace(".000Z", "Z");

const repeated = (name: string, values: string[]) => values.map((value) => [name, value]);

const spanned = (startMs: number, endMs: number) => [
  ["start", rfc3339(startMs)],
  ["end", rfc3339(endMs)],
];

export const historyApi = {
  stored: (robot: string) => request<Stored>(`${robotPath(robot)}/history`),
  density: (robot: string, startMs: number, endMs: number, buckets: number, signal?: AbortSignal) => {
    const query = new URLSearchParams([...spanned(startMs, endMs), ["buckets", String(buckets)]]);
    return request<Density>(`${robotPath(robot)}/timeline?${query}`, { signal });
  },
  /** The newest sample of each topic at or before `tMs`, not older than `maxAgeS`. */
  at: (robot: string, tMs: number, topics: string[], maxAgeS: number, signal?: AbortSignal) => {
    const query = new URLSearchParams([["t", rfc3339(tMs)], ...repeated("topic", topics), ["max_age", `${maxAgeS}s`]]);
    return requestBytes(`${robotPath(robot)}/at?${query}`, { signal });
  },
  messages: async (robot: string, topics: string[], startMs: number, endMs: number, limit: number, signal?: AbortSignal) => {
    const query = new URLSearchParams([...repeated("topic", topics), ...spanned(startMs, endMs), ["limit", String(limit)], ["format", "cdr"]]);
    return (await request<{ messages: StoredMessage[] }>(`${robotPath(robot)}/messages?${query}`, { signal })).messages;
  },
  range: (robot: string, names: string[], startMs: number, endMs: number, points: number, signal?: AbortSignal) => {
    const query = new URLSearchParams([...repeated("name", names), ...spanned(startMs, endMs), ["points", String(points)]]);
    return request<Ranged>(`${robotPath(robot)}/metrics/range?${query}`, { signal });
  },
};
