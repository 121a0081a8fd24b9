/** The plots around an instant: stored series, losses hatched, a line at the instant. */

import { signal, useComputed, useSignal, useSignalEffect, type Signal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { historyApi } from "../../api/history";
import type { Ranged, Span } from "../../api/history_types";
import { now } from "../../live/age";
import { Latest } from "../../history/latest";
import { moving } from "../../history/moment";
import { frameAround } from "../../history/span";
import { useLive } from "../../ui/context";
import { Card } from "../../ui/parts";
import { PAST_PLOTS, plotsOf, type PlotSpec } from "./plot_table";
import type { Frame } from "./frame";
import { Plot } from "./plot";
import { drawCursor } from "./plot_cursor";
import { HOLE_S, isBroken, Timeline } from "./timeline";

/** Of what is loaded at once, so that moving a little needs no request: the shown span is half of it. */
const POINTS = 400;

interface Track {
  spec: PlotSpec;
  timelines: Timeline[];
  version: Signal<number>;
}

interface Loaded {
  startMs: number;
  endMs: number;
  ranged: Ranged;
}

/** Lay what came into the lines: breaks where something between two points is lost. */
function fill(track: Track, ranged: Ranged, holes: Span[]): void {
  track.spec.lines.forEach((line, i) => {
    const found = ranged.series.find(({ name }) => name === line.series);
    const timeline = track.timelines[i]!;
    let last = -Infinity;
    found?.stamp_ms.forEach((stamp, at) => {
      if (isBroken(holes, last, stamp)) timeline.cut();
      timeline.add(stamp, found.mean[at]! * (line.factor ?? 1));
      last = stamp;
    });
  });
  track.version.value += 1;
}

export function PastPlots({ robot, names, windowS }: { robot: string; names: string[]; windowS: number }) {
  const { at } = useLive();
  const known = names.join("\n");
  const specs = useMemo(() => plotsOf(new Set(names), PAST_PLOTS), [known]);
  const windowMs = windowS * 1000;
  const holeS = Math.max(HOLE_S, (windowS * 2 * 3) / POINTS);
  const newTracks = () => specs.map((spec) => ({ spec, timelines: spec.lines.map(() => new Timeline(Infinity, holeS)), version: signal(0) }));
  const tracks = useMemo<Track[]>(newTracks, [specs, windowS]);
  const loaded = useSignal<Loaded | null>(null);
  const problem = useSignal("");
  const asked = useRef(0);

  const latest = useMemo(
    () =>
      new Latest<Loaded>(
        (answer) => {
          const holes = holesOf(answer.ranged);
          for (const track of tracks) {
            track.timelines.forEach((timeline) => timeline.clear());
            fill(track, answer.ranged, holes);
          }
          problem.value = "";
          loaded.value = answer;
        },
        (error) => (problem.value = String(error)),
      ),
    [robot, tracks],
  );
  useEffect(() => () => latest.close(), [latest]);
  useEffect(() => {
    loaded.value = null;
    asked.current = 0;
  }, [tracks]);

  useSignalEffect(() => {
    const tMs = at.value;
    const series = tracks.flatMap(({ spec }) => spec.lines.map((line) => line.series));
    const preview = moving.value;
    const near = Math.abs(tMs - asked.current) < windowMs / 4 && tMs < now.peek() - windowMs;
    if (near || series.length === 0) {
      if (!preview) latest.settle();
      return;
    }
    asked.current = tMs;
    const startMs = tMs - windowMs;
    const endMs = tMs + windowMs;
    latest.ask(async (abort) => ({ startMs, endMs, ranged: await historyApi.range(robot, series, startMs, endMs, POINTS, abort) }), { preview });
  });
  const frame = useComputed<Frame | null>(() => {
    const tMs = at.value;
    const shown = frameAround(tMs, windowMs, now.peek());
    const has = loaded.value;
    if (!has || shown.startMs < has.startMs || shown.endMs > has.endMs) return null;
    return { ...shown, cursorMs: tMs, holes: holesOf(has.ranged) };
  });
  // A frame that is not loaded yet keeps the last one, so that a drag does not flicker.
  const shownFrame = useSignal<Frame | null>(null);
  useSignalEffect(() => {
    if (frame.value) shownFrame.value = frame.value;
  });

  return (
    <>
      {problem.value && <p class="problem" role="status">{problem.value}</p>}
      {tracks.map((track) => (
        <Card key={`${track.spec.title} ${windowS}`} title={track.spec.title} kind="plot" topic={track.spec.lines[0]!.series}>
          <Plot
            timelines={track.timelines}
            labels={track.spec.lines.map(({ label }) => label)}
            unit={track.spec.unit}
            digits={track.spec.digits}
            bounds={track.spec.bounds}
            windowS={windowS}
            version={track.version}
            frame={shownFrame}
            cursor={drawCursor}
          />
        </Card>
      ))}
    </>
  );
}

const holesOf = ({ gaps = [] }: Ranged): Span[] => gaps.map(([from_ms, to_ms]) => ({ from_ms, to_ms }));
