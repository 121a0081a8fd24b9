/** Lines of a function's log: what is kept of them in the page, and how a pause holds them back. */

import type { LogLine } from "../api/functions";

export const MOST_LINES = 2000;

/** Lines behind those that are there; the oldest go when there are too many, and none comes twice. */
export function behind(lines: LogLine[], more: LogLine[]): LogLine[] {
  const last = lines.at(-1)?.cursor ?? -1;
  const fresh = more.filter(({ cursor }) => cursor > last);
  return fresh.length === 0 ? lines : [...lines, ...fresh].slice(-MOST_LINES);
}

export type LineKind = "mark" | "report" | "error" | "warn" | "";

/** The runtime's own lines are quieter than what the function says; what went wrong stands out. */
export function kindOf(text: string): LineKind {
  if (/^(START|END) RequestId/.test(text)) return "mark";
  if (/^(REPORT|INIT_REPORT) /.test(text)) return "report";
  if (/Task timed out|^\[?(ERROR|CRITICAL|FATAL)\b|Traceback|^\w*(Error|Exception)\b/.test(text)) return "error";
  return /^\[?WARN/.test(text) ? "warn" : "";
}
