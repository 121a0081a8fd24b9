/** Reads a node's log for as long as it is looked at: the newest page, what comes after it, and older pages on demand. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { saidOf } from "../api/client";
import { nodesApi, type LogPage } from "../api/nodes";
import { begunWith, olderFrom, withNewer, withOlder, type Log } from "./log_lines";

const FIRST_BYTES = "16384";
const OLDER_BYTES = "65536";

const AGAIN_MS = 3000;

export interface LogOptions {
  query: string;
  following: boolean;
  /** Another answer may come when this changes. */
  online: boolean;
}

export interface ReadLog {
  log: Signal<Log | null>;
  problem: Signal<string>;
  state: Signal<"" | "live" | "broken">;
  asking: Signal<boolean>;
  older: () => Promise<void>;
}

export function useLog(robot: string, node: string, { query, following, online }: LogOptions): ReadLog {
  const log = useSignal<Log | null>(null);
  const problem = useSignal("");
  const state = useSignal<"" | "live" | "broken">("");
  const asking = useSignal(false);
  const search: Record<string, string> = query ? { query } : {};

  useEffect(() => {
    let gone = false;
    let source: EventSource | null = null;
    let again: ReturnType<typeof setTimeout> | undefined;
    const follow = () => {
      source = new EventSource(nodesApi.tailUrl(robot, node, { ...search, cursor: log.peek()?.end ?? "" }));
      source.addEventListener("open", () => (state.value = "live"));
      source.addEventListener("error", () => {
        state.value = "broken"; // it tries again by itself, from its last cursor; unless it was refused
        if (source?.readyState === EventSource.CLOSED && !gone) again = setTimeout(follow, AGAIN_MS);
      });
      source.addEventListener("lines", ({ data }: MessageEvent<string>) => {
        const before = log.peek();
        if (before) log.value = withNewer(before, JSON.parse(data) as LogPage);
      });
      source.addEventListener("end", ({ data }: MessageEvent<string>) => {
        const { code, message } = JSON.parse(data) as { code: string; message: string };
        source?.close();
        state.value = "";
        if (code !== OVER) problem.value = message;
        else if (!gone) follow();
      });
    };
    const read = async () => {
      try {
        const page = await nodesApi.log(robot, node, { ...search, max_bytes: FIRST_BYTES });
        if (gone) return;
        log.value = begunWith(page);
        problem.value = "";
        if (following) follow();
      } catch (error) {
        if (!gone) problem.value = saidOf(error);
      }
    };
    void read();
    return () => {
      gone = true;
      clearTimeout(again);
      source?.close();
      state.value = "";
    };
  }, [robot, node, query, following, online]);

  const older = async () => {
    const before = log.value;
    if (!before || asking.value) return;
    asking.value = true;
    try {
      const page = await nodesApi.log(robot, node, { ...search, cursor: olderFrom(before), backwards: "true", max_bytes: OLDER_BYTES });
      if (log.value) log.value = withOlder(log.value, page);
    } catch (error) {
      problem.value = saidOf(error);
    }
    asking.value = false;
  };
  return { log, problem, state, asking, older };
}

/** The gateway lets nobody follow for ever; one may ask again. */
const OVER = "tail_over";
