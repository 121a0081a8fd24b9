/** Follows a function's log while it is looked at: the lines that the gateway remembers, then each as it is printed. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { saidOf } from "../api/client";
import { functionsApi, type LogLine } from "../api/functions";
import { behind } from "./tail";

const FIRST = 200;
const AGAIN_MS = 3000;
/** Many lines at once are one change of the page. */
const GATHER_MS = 60;

export interface Tail {
  lines: Signal<LogLine[] | null>;
  problem: Signal<string>;
  live: Signal<boolean>;
}

export function useTail(name: string): Tail {
  const lines = useSignal<LogLine[] | null>(null);
  const problem = useSignal("");
  const live = useSignal(false);
  useEffect(() => {
    let gone = false;
    let source: EventSource | null = null;
    let again: ReturnType<typeof setTimeout> | undefined;
    let gather: ReturnType<typeof setTimeout> | undefined;
    let came: LogLine[] = [];
    let last: number | null = null;
    const later = (what: () => void) => {
      if (!gone) again = setTimeout(what, AGAIN_MS);
    };
    const follow = () => {
      source = new EventSource(functionsApi.tailUrl(name, last));
      source.onopen = () => (live.value = true);
      source.onmessage = ({ data }: MessageEvent<string>) => {
        const line = JSON.parse(data) as LogLine;
        last = line.cursor;
        came.push(line);
        gather ??= setTimeout(() => {
          gather = undefined;
          lines.value = behind(lines.peek() ?? [], came);
          came = [];
        }, GATHER_MS);
      };
      source.onerror = () => {
        live.value = false; // it tries again by itself, unless it was refused
        if (source?.readyState === EventSource.CLOSED) later(follow);
      };
      source.addEventListener("end", () => {
        source?.close();
        live.value = false;
        later(follow);
      });
    };
    const read = async () => {
      try {
        const page = await functionsApi.log(name, FIRST);
        if (gone) return;
        lines.value = page.lines;
        last = page.lines.at(-1)?.cursor ?? null;
        problem.value = "";
        follow();
      } catch (error) {
        problem.value = saidOf(error);
        later(() => void read());
      }
    };
    void read();
    return () => {
      gone = true;
      clearTimeout(again);
      clearTimeout(gather);
      source?.close();
    };
  }, [name]);
  return { lines, problem, live };
}
