/** A list of the gateway's that is asked for again while somebody looks at it. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { saidOf } from "../api/client";

export interface Asked<T> {
  /** Null before the first answer. */
  value: Signal<T | null>;
  problem: Signal<string>;
  refresh: () => Promise<void>;
}

/** Asks at once, then every `everyMs` while the page is in view; an answer that comes after a newer one is dropped. */
export function useAsked<T>(ask: () => Promise<T>, everyMs: number): Asked<T> {
  const value = useSignal<T | null>(null);
  const problem = useSignal("");
  const asked = useRef(0);
  const latest = useRef(ask);
  latest.current = ask;
  const refresh = async () => {
    const mine = ++asked.current;
    try {
      const found = await latest.current();
      if (mine !== asked.current) return;
      value.value = found;
      problem.value = "";
    } catch (error) {
      if (mine === asked.current) problem.value = saidOf(error);
    }
  };
  useEffect(() => {
    void refresh();
    const timer = setInterval(() => {
      if (!document.hidden) void refresh();
    }, everyMs);
    return () => clearInterval(timer);
  }, [everyMs]);
  return { value, problem, refresh };
}
