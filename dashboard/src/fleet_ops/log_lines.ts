/** A log as the page holds it: what was there, older pages before it, and what comes; bounded. */

import type { LogLine, LogPage } from "../api/nodes";

export const MOST_LINES = 5000;

export interface Log {
  lines: LogLine[];
  /** Where older lines end; null while only the newest page was read. */
  begin: string | null;
  /** Where the first page ended: what came later was not there then. */
  first: { cursor: string; count: number };
  /** Where to go on. */
  end: string;
  /** There are older ones, as far as is known. */
  older: boolean;
}

export const begunWith = ({ lines, cursor }: LogPage): Log => ({ lines, begin: null, first: { cursor, count: lines.length }, end: cursor, older: lines.length > 0 });

/** New lines at the end; the oldest go where there are too many. */
export function withNewer(log: Log, { lines, cursor }: Pick<LogPage, "lines" | "cursor">): Log {
  const all = [...log.lines, ...lines];
  const over = Math.max(0, all.length - MOST_LINES);
  return { ...log, lines: over ? all.slice(over) : all, end: cursor || log.end, first: { ...log.first, count: Math.max(0, log.first.count - over) }, older: log.older && over === 0 };
}

/** From where older lines are asked for. */
export const olderFrom = (log: Log) => log.begin ?? log.first.cursor;

/** An older page. The first one holds the newest page as well, which it takes the place of. */
export function withOlder(log: Log, { lines, cursor, more }: LogPage): Log {
  const rest = log.begin === null ? log.lines.slice(log.first.count) : log.lines;
  return { ...log, lines: [...lines, ...rest], begin: cursor, older: more };
}
