/** The strip of the time bar: drag, click or press keys to move the instant; hover to see what is there. */

import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Density, Recording } from "../../api/history_types";
import { setMoment } from "../../history/moment";
import { pause, play, playing } from "../../history/player";
import { msOf, xOf, type Window } from "../../history/span";
import { useCanvas } from "../../ui/canvas";
import { clockTime, dayText, integer } from "../../ui/format";
import { reasonWords } from "../../ui/reasons";
import { palette } from "../../ui/theme";
import { marks } from "../plots/overlay";
import { drawStrip } from "./strip_draw";

export interface StripProps {
  window: Window;
  density: Density | null;
  recordings: Recording[];
  cursorMs: number | null;
  firstMs: number | null;
}

/** Let go this near to the right edge of a window that ends now, it is LIVE again. */
const SNAP_PX = 5;

export function StripView({ window: shown, density, recordings, cursorMs, firstMs }: StripProps) {
  const hover = useSignal<number | null>(null);
  const dragging = useRef(false);
  const { ref, redraw } = useCanvas((surface) => {
    drawStrip(surface, { window: shown, density, recordings }, palette.peek());
  });
  useEffect(redraw, [shown.startMs, shown.endMs, density, recordings]);
  useSignalEffect(() => {
    if (palette.value) redraw();
  });

  const move = (event: PointerEvent, settled: boolean) => {
    const box = ref.current!.getBoundingClientRect();
    const ms = msOf(shown, box.width, event.clientX - box.left);
    hover.value = event.pointerType === "touch" ? null : ms;
    if (!dragging.current) return;
    const isNow = shown.endMs > Date.now() - 2000 && event.clientX > box.right - SNAP_PX;
    setMoment(isNow && settled ? null : ms, { moves: !settled });
  };
  const keyed = (event: KeyboardEvent) => {
    if (!steer(event, { atMs: cursorMs ?? Date.now(), spanMs: shown.endMs - shown.startMs, firstMs })) return;
    event.preventDefault();
    event.stopPropagation();
  };
  const at = hover.value;
  return (
    <div
      class="strip"
      role="slider"
      tabIndex={0}
      aria-label="Instant shown"
      aria-valuemin={Math.round(shown.startMs / 1000)}
      aria-valuemax={Math.round(shown.endMs / 1000)}
      aria-valuenow={Math.round((cursorMs ?? shown.endMs) / 1000)}
      aria-valuetext={cursorMs === null ? "Live" : `${clockTime(cursorMs)}, ${dayText(cursorMs)}`}
      data-start-ms={Math.round(shown.startMs)}
      data-end-ms={Math.round(shown.endMs)}
      data-gaps={density?.gaps.length ?? ""}
      data-messages={density?.messages.reduce((sum, count) => sum + count, 0) ?? ""}
      data-recordings={recordings.length}
      onKeyDown={keyed}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        pause();
        dragging.current = true;
        event.currentTarget.setPointerCapture(event.pointerId);
        move(event, false);
      }}
      onPointerMove={(event) => {
        move(event, false);
      }}
      onPointerUp={(event) => {
        move(event, true);
        dragging.current = false;
      }}
      onPointerCancel={() => (dragging.current = false)}
      onPointerLeave={() => (hover.value = null)}
    >
      <canvas ref={ref} aria-hidden="true" />
      {at !== null && <i class="hover-line" style={{ left: `${xOf(shown, 100, at)}%` }} />}
      <i class={cursorMs === null ? "cursor cursor-live" : "cursor"} style={{ left: `${cursorMs === null ? 100 : xOf(shown, 100, cursorMs)}%` }} />
      {marks.value && <marks.value.View alerts={marks.value.alerts} window={shown} hoverMs={at} />}
      {at !== null && <Bubble at={at} window={shown} density={density} recordings={recordings} />}
    </div>
  );
}

/** What a key does to the instant; false for a key that is none of ours. */
function steer(event: KeyboardEvent, now: { atMs: number; spanMs: number; firstMs: number | null }): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const stepMs = event.shiftKey ? 10_000 : 1000;
  const steps: Record<string, number> = { ArrowLeft: -stepMs, ArrowRight: stepMs, PageUp: -now.spanMs / 10, PageDown: now.spanMs / 10 };
  const step = steps[event.key];
  if (event.key === "End") setMoment(null);
  else if (event.key === "Home" && now.firstMs !== null) setMoment(now.firstMs);
  else if (event.key === " ") playing.peek() ? pause() : play();
  else if (step === undefined) return false;
  else setMoment(now.atMs + step >= Date.now() ? null : now.atMs + step);
  return true;
}

/** The time under the pointer, and what is stored or lost there. */
function Bubble({ at, window: shown, density, recordings }: { at: number; window: Window; density: Density | null; recordings: Recording[] }) {
  const slack = (shown.endMs - shown.startMs) / 400;
  const loss = density?.gaps.find(({ from_ms, to_ms }) => at >= from_ms - slack && at <= to_ms + slack);
  const offline = density?.offline?.some(({ from_ms, to_ms }) => at >= from_ms && at <= to_ms);
  const recording = recordings.find(({ start, end }) => at >= Date.parse(start) - slack && at <= Date.parse(end) + slack);
  const bucket = density ? Math.floor((at - density.start_ms) / density.width_ms) : -1;
  const count = density ? (density.messages[bucket] ?? 0) + (density.rows[bucket] ?? 0) : 0;
  return (
    <span class="bubble" style={{ left: `clamp(70px, ${xOf(shown, 100, at).toFixed(2)}%, calc(100% - 70px))` }}>
      <b class="num">{clockTime(at)}</b>
      {loss ? <span class="bubble-loss">{integer(loss.count)} lost: {reasonWords(loss.reason)}</span> : offline ? <span>no link</span> : <span class="num">{integer(count)} samples</span>}
      {recording && <span class="bubble-recording">recording {recording.state}</span>}
    </span>
  );
}
