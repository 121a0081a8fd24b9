/** A log as the page holds it: what was there, older pages before it, and what comes; bounded. */

import type { LogLine, LogPage } from "../api/nodes";

export const MOST_LINES = 5000;
export const MOST_CHARS = 2_000_000;

export interface Log {
  lines: LogLine[];
  /** The first line's number: what a line is known by while others come and go around it. */
  base: number;
  /** Where older lines end; null while only the newest page was read. */
  begin: string | null;
  /** Where the first page ended, and how many of its lines are here still. */
  first: { cursor: string; count: number };
  /** Where to go on. */
  end: string;
  /** There may be older ones, and there is room for them. */
  older: boolean;
}

export const begunWith = ({ lines, cursor }: LogPage): Log => ({ lines, base: 0, begin: null, first: { cursor, count: lines.length }, end: cursor, older: lines.length > 0 });

/** How many of the oldest lines are too many. */
function surplus(lines: readonly LogLine[]): number {
  let chars = 0;
  let kept = 0;
  while (kept < Math.min(lines.length, MOST_LINES) && chars <= MOST_CHARS) chars += lines[lines.length - ++kept]!.text.length;
  return lines.length - kept;
}

/** New lines at the end; the oldest go where there are too many, and with them the way back. */
export function withNewer(log: Log, { lines, cursor }: Pick<LogPage, "lines" | "cursor">): Log {
  const all = [...log.lines, ...lines];
  const over = surplus(all);
  return {
    ...log,
    lines: over > 0 ? all.slice(over) : all,
    base: log.base + over,
    end: cursor || log.end,
    first: { ...log.first, count: Math.max(0, log.first.count - over) },
    older: log.older && over === 0,
  };
}

/** From where older lines are asked for. */
export const olderFrom = (log: Log) => log.begin ?? log.first.cursor;

/** An older page. The first one holds the newest page as well, which it takes the place of. */
export function withOlder(log: Log, { lines, cursor, more }: LogPage): Log {
  const gone = log.begin === null ? log.first.count : 0;
  const all = [...lines, ...log.lines.slice(gone)];
  return { ...log, lines: all, base: log.base + gone - lines.length, begin: cursor, older: more && surplus(all) === 0 };
}
