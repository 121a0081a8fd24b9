/** What the time bar draws: how much is stored when, and which recordings there are; kept fresh while it is in view. */

import { signal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { saidOf } from "../api/client";
import { historyApi } from "../api/history";
import type { Density, Recording, Stored } from "../api/history_types";
import { recordingsApi } from "../api/recordings";
import { useLive } from "../ui/context";
import { Latest } from "./latest";
import type { Window } from "./span";

const BUCKETS = 240;
const REFRESH_MS = 5000;

/** The density of a window, asked anew when the window jumps, and every few seconds while it reaches the present. */
export function useDensity(robot: string, window: Window): { found: Density | null; problem: string } {
  const [found, problem] = useMemo(() => [signal<Density | null>(null), signal("")], [robot]);
  const latest = useMemo(
    () =>
      new Latest<Density>(
        (density) => {
          found.value = density;
          problem.value = "";
        },
        (error) => (problem.value = saidOf(error)),
      ),
    [robot],
  );
  useEffect(() => () => latest.close(), [latest]);
  const spanMs = window.endMs - window.startMs;
  // A window that slides with the present is the same question for a while.
  const turn = Math.floor(window.endMs / Math.max(REFRESH_MS, spanMs / BUCKETS));
  useEffect(() => {
    if (!document.hidden) latest.ask((abort) => historyApi.density(robot, window.startMs, window.endMs, BUCKETS, abort));
  }, [latest, spanMs, turn]);
  return { found: found.value, problem: problem.value };
}

const LIST_EVERY_MS = 10_000;

/** Ask at once, again when the connection is back, and every `everyMs`; failures leave what was there. */
export function usePolled<T>(ask: () => Promise<T>, key: string, everyMs: number): ReadonlySignal<T | null> {
  const { stream } = useLive();
  const found = useMemo(() => signal<T | null>(null), [key]);
  useEffect(() => {
    let gone = false;
    const refresh = async () => {
      if (document.hidden) return;
      const answer = await ask().catch(() => null);
      if (!gone && answer !== null) found.value = answer;
    };
    const timer = setInterval(() => void refresh(), everyMs);
    const stop = stream.state.subscribe((state) => {
      if (state === "open") void refresh();
    });
    return () => {
      gone = true;
      clearInterval(timer);
      stop();
    };
  }, [found, everyMs]);
  return found;
}

export const useStored = (robot: string): ReadonlySignal<Stored | null> =>
  usePolled(() => historyApi.stored(robot), robot, LIST_EVERY_MS);

export const useRecordings = (robot: string): ReadonlySignal<Recording[] | null> =>
  usePolled(() => recordingsApi.list(robot), robot, LIST_EVERY_MS);
