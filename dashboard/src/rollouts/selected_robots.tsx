/** The robots that a selector selects, fetched from the gateway shortly after the last key. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { request, saidOf } from "../api/client";
import { robots } from "../live/fleet";
import { robotsText } from "./words";

const PAUSE_MS = 350;
const SHOWN = 40;

export interface SelectedRobots {
  /** Null while it is asked. */
  robots: string[] | null;
  problem: string;
}

export function useSelectedRobots(selector: string): Signal<SelectedRobots> {
  const named = useSignal<SelectedRobots>({ robots: null, problem: "" });
  useEffect(() => {
    const stop = new AbortController();
    named.value = { robots: null, problem: "" };
    const timer = setTimeout(async () => {
      try {
        const query = new URLSearchParams({ selector });
        const found = await request<{ twins: { robot: string }[] }>(`/twins?${query}`, { signal: stop.signal });
        named.value = { robots: found.twins.map(({ robot }) => robot), problem: "" };
      } catch (error) {
        if (!stop.signal.aborted) named.value = { robots: [], problem: saidOf(error) };
      }
    }, PAUSE_MS);
    return () => {
      clearTimeout(timer);
      stop.abort();
    };
  }, [selector]);
  return named;
}

/** How many, how many of them are away, and which. */
export function SelectedRobotsList({ named }: { named: SelectedRobots }) {
  if (named.problem) return <p class="bad wrap" role="alert">{named.problem}</p>;
  const names = named.robots;
  if (names === null) return <p class="hint">Looking…</p>;
  const away = new Set((robots.value ?? []).filter(({ state }) => state !== "online").map(({ id }) => id));
  const offline = names.filter((name) => away.has(name)).length;
  return (
    <div class="named" data-named={names.length} role="status">
      <p><b>{names.length === 0 ? "No robot" : robotsText(names.length)}</b>{offline > 0 && <>, <span class="warn">{offline} of them offline</span>: told when they are back</>}</p>
      {names.length > 0 && (
        <p class="named-list">
          {names.slice(0, SHOWN).map((name) => <span key={name} class={away.has(name) ? "chip chip-away" : "chip"}>{name}</span>)}
          {names.length > SHOWN && <span>and {(names.length - SHOWN).toLocaleString("en")} more</span>}
        </p>
      )}
    </div>
  );
}
