/** The time bar of a robot: LIVE, or an instant of what is stored, that every panel then shows. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { can } from "../../api/session";
import type { Recording } from "../../api/history_types";
import { ageText, now } from "../../live/age";
import { useDensity, useRecordings, useStored } from "../../history/density";
import { moment, setMoment } from "../../history/moment";
import { pause, play, playing, speed, SPEEDS } from "../../history/player";
import { SPANS, USUAL_SPAN, windowFor, type Window } from "../../history/span";
import { clockTime, dayText, zoneName } from "../../ui/format";
import { place, setParam } from "../../ui/url";
import { useWindowKey } from "../../ui/use_window_key";
import { SaveButton } from "./save_button";
import { StripView } from "./strip";

const NO_RECORDINGS: Recording[] = [];

export function TimeBar({ robot }: { robot: string }) {
  const tMs = moment.value;
  const nowMs = now.value;
  const asked = place.value.params.get("span") ?? "";
  const span = asked in SPANS ? asked : USUAL_SPAN;
  const last = useRef<Window | null>(null);
  const shown = windowFor(last.current, tMs, SPANS[span]!, nowMs);
  last.current = tMs === null ? null : shown;
  const density = useDensity(robot, shown);
  const recordings = useRecordings(robot).value ?? NO_RECORDINGS;
  const stored = useStored(robot).value;
  useEffect(() => pause, [robot]);
  useLiveKey();
  return (
    <section class="timebar" data-mode={tMs === null ? "live" : "past"} data-t={tMs ?? ""} data-playing={playing.value} aria-label="Time">
      <div class="timebar-row">
        <LiveButton live={tMs === null} />
        {tMs !== null && <Playing />}
        <Clock tMs={tMs} nowMs={nowMs} />
        <span class="timebar-end">
          {can("recordings.save") && <SaveButton robot={robot} tMs={tMs} />}
          <span class="segments" role="group" aria-label="Span of the time bar">
            {Object.keys(SPANS).map((choice) => (
              <button key={choice} type="button" aria-pressed={choice === span} onClick={() => setParam("span", choice, USUAL_SPAN)}>
                {choice}
              </button>
            ))}
          </span>
        </span>
      </div>
      <StripView
        window={shown}
        density={density.found}
        recordings={recordings}
        cursorMs={tMs}
        firstMs={stored?.first ? Date.parse(stored.first) : null}
      />
      {density.problem && <p class="problem" role="status">{density.problem}</p>}
      {stored && stored.topics.length === 0 && stored.series === 0 && (
        <p class="strip-empty">Nothing of this robot is stored yet. What it sends from now on appears here.</p>
      )}
    </section>
  );
}

function LiveButton({ live }: { live: boolean }) {
  return (
    <button type="button" class="live-button" aria-pressed={live} title="l" onClick={() => setMoment(null)}>
      <i aria-hidden="true" /> {live ? "Live" : "Go live"}
    </button>
  );
}

/** `l` goes back to LIVE from anywhere on the page, except while somebody types. */
function useLiveKey(): void {
  useWindowKey((event) => {
    const typing = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement;
    if (event.key === "l" && !typing && !event.ctrlKey && !event.metaKey && !event.altKey) setMoment(null);
  });
}

function Playing() {
  const runs = playing.value;
  return (
    <>
      <button type="button" class="button play" aria-label={runs ? "Pause" : "Play"} onClick={() => (runs ? pause() : play())}>
        <svg viewBox="0 0 12 12" aria-hidden="true"><path d={runs ? "M2 1h3v10H2ZM7 1h3v10H7Z" : "M2.5 1 10.5 6l-8 5Z"} /></svg>
      </button>
      <span class="segments speeds" role="group" aria-label="Speed of playing">
        {SPEEDS.map((choice) => (
          <button key={choice} type="button" aria-pressed={choice === speed.value} onClick={() => (speed.value = choice)}>
            ×{choice}
          </button>
        ))}
      </span>
    </>
  );
}

function Clock({ tMs, nowMs }: { tMs: number | null; nowMs: number }) {
  const picker = useRef<HTMLInputElement>(null);
  const shown = tMs ?? nowMs;
  const open = useSignal(false);
  return (
    <span class="timebar-clock">
      <b class="num">{clockTime(shown)}</b>
      <span class="num"> {dayText(shown)} {zoneName(shown)}</span>
      {tMs !== null && <span class="ago num">{ageText(nowMs - tMs)} ago</span>}
      <button
        type="button"
        class="pick"
        aria-label="Go to a time"
        title="Go to a time"
        onClick={() => {
          open.value = !open.value;
          picker.current!.value = localValue(shown);
        }}
      >
        <svg viewBox="0 0 16 16" aria-hidden="true"><path d="M2 4h12v10H2ZM2 7h12M5 2v3M11 2v3" /></svg>
      </button>
      <input
        ref={picker}
        type="datetime-local"
        step="1"
        aria-label="Time to go to"
        hidden={!open.value}
        onChange={(event) => {
          const ms = new Date(event.currentTarget.value).getTime();
          if (Number.isFinite(ms)) setMoment(ms >= Date.now() ? null : ms);
        }}
      />
    </span>
  );
}

/** What an input of type datetime-local holds: the reader's own time, without a zone. */
function localValue(ms: number): string {
  const offsetMs = new Date(ms).getTimezoneOffset() * 60_000;
  return new Date(ms - offsetMs).toISOString().slice(0, 19);
}
