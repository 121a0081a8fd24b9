/** The plot of an alert's series: its values, the band that was expected, and the moment. */

import { signal, useSignal, type Signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { alertsApi, type Alert, type BandPoint } from "../../api/alerts";
import { saidOf } from "../../api/client";
import { historyApi } from "../../api/history";
import type { Ranged } from "../../api/history_types";
import type { Window } from "../../history/span";
import type { Overlay } from "../../panels/plots/overlay";
import type { Frame } from "../../panels/plots/frame";
import { Plot } from "../../panels/plots/plot";
import { drawCursor } from "../../panels/plots/plot_cursor";
import { HOLE_S, isBroken, Timeline } from "../../panels/plots/timeline";
import { AROUND, isOnAxis, ownBounds, reach, rememberedOf, usualAround, windowOf } from "./band";
import { drawBand, drawMoment, drawOutside, drawScores, drawSpan } from "./draw";
import { expectedText, unitOf, valueText } from "../units";
import { beganMs, endedMs } from "../words";

const POINTS = 600;
const HEIGHT_PX = 230;
const EVERY_MS = 5000;

export function BandCard({ alert }: { alert: Alert }) {
  const around = useSignal(useMemo(() => usualAround(alert, Date.now()), [alert.id]));
  const fits = useSignal(false);
  const unit = unitOf(alert.series);
  const expected = expectedText(alert.low, alert.high, unit);
  return (
    <section class="card card-plot card-band" data-card="band" aria-label="Values">
      <header>
        <h2>{unit.title}</h2>
        <span class="note">{fits.value && [valueText(alert.value, unit), expected && `expected ${expected}`].filter(Boolean).join(", ")}</span>
        <span class="segments" role="group" aria-label="Span of the plot">
          {Object.keys(AROUND).map((word) => (
            <button key={word} type="button" aria-pressed={word === around.value} onClick={() => (around.value = word)}>{word}</button>
          ))}
        </span>
      </header>
      <BandPlot key={around.value} alert={alert} spanMs={AROUND[around.value]!} fits={fits} />
    </section>
  );
}

interface Shown {
  timeline: Timeline;
  version: Signal<number>;
  frame: Signal<Frame | null>;
  overlay: Signal<Overlay | null>;
  bounds: [number, number];
}

const made = (spanMs: number): Shown => ({
  timeline: new Timeline(Infinity, Math.max(HOLE_S, spanMs / 100_000)),
  version: signal(0),
  frame: signal<Frame | null>(null),
  overlay: signal<Overlay | null>(null),
  bounds: [0, 1],
});

/** `fits` becomes whether the alert's own numbers are on the plot's axis. */
function BandPlot({ alert, spanMs, fits }: { alert: Alert; spanMs: number; fits: Signal<boolean> }) {
  const unit = unitOf(alert.series);
  const shown = useMemo(() => made(spanMs), [alert.series, spanMs]);
  const timelines = useMemo(() => [shown.timeline], [shown]);
  const problem = useSignal("");
  const empty = useSignal(false);
  const goesOn = endedMs(alert) === null;
  useEffect(() => {
    let gone = false;
    const load = async () => {
      if (document.hidden) return;
      const moment = beganMs(alert);
      const window = windowOf(moment, spanMs, Date.now());
      try {
        const [ranged, points] = await Promise.all([
          historyApi.range(alert.robot, [alert.series], window.startMs, window.endMs, POINTS),
          alertsApi.band(alert.robot, alert.series, window.startMs, window.endMs).catch((): BandPoint[] => []), // a plot without its band is one all the same
        ]);
        if (gone) return;
        fits.value = fill(shown, alert, ranged, points, window, unit.factor);
        problem.value = "";
        empty.value = shown.timeline.times.length === 0;
      } catch (error) {
        if (!gone) problem.value = saidOf(error);
      }
    };
    void load();
    const timer = setInterval(() => goesOn && void load(), EVERY_MS);
    return () => {
      gone = true;
      clearInterval(timer);
    };
  }, [shown, alert.revision]);
  return (
    <>
      {problem.value && <p class="problem" role="status">{problem.value}</p>}
      <Plot
        timelines={timelines}
        labels={["at the moment"]}
        unit={unit.unit}
        digits={unit.digits}
        bounds={() => shown.bounds}
        windowS={spanMs / 1000}
        version={shown.version}
        height={HEIGHT_PX}
        frame={shown.frame}
        cursor={drawCursor}
        overlay={shown.overlay}
      />
      <p class="band-legend" data-points={empty.value ? 0 : undefined}>
        {empty.value ? "Nothing of it is stored around that time." : <><span><i class="legend-band" /> expected</span><span><i class={`legend-moment severity-${alert.severity}`} /> the moment, and as long as it went on</span></>}
      </p>
    </>
  );
}

/** Lay the answers into the plot, in the units that it shows; whether the alert's own numbers are of them. */
function fill(shown: Shown, alert: Alert, ranged: Ranged, points: BandPoint[], window: Window, factor: number): boolean {
  const { timeline } = shown;
  const holes = (ranged.gaps ?? []).map(([from_ms, to_ms]) => ({ from_ms, to_ms }));
  timeline.clear();
  let last = -Infinity;
  for (const [stamp, value] of valuesOf(ranged, alert.series, points)) {
    if (isBroken(holes, last, stamp)) timeline.cut();
    timeline.add(stamp, value * factor);
    last = stamp;
  }
  const fits = isOnAxis(alert.value === null ? null : alert.value * factor, timeline.values);
  const remembered = rememberedOf(points, timeline.values, factor);
  const band = remembered.length > 1 ? remembered : fits ? ownBounds(alert, window, factor) : [];
  shown.bounds = reach(timeline.values, band);
  shown.overlay.value = {
    under: (plot, colours) => {
      drawSpan(plot, alert, colours, 0.09);
      drawBand(plot, band, colours);
    },
    over: (plot, colours) => {
      drawOutside(plot, remembered, alert.severity, colours); // its own bounds say nothing of other times
      drawScores(plot, remembered, alert.severity, colours);
      drawMoment(plot, alert, colours, false);
    },
  };
  shown.frame.value = { ...window, cursorMs: beganMs(alert), holes };
  shown.version.value += 1;
  return fits;
}

/** What is stored of the series; where nothing is, what the gateway remembers. */
function valuesOf(ranged: Ranged, series: string, points: BandPoint[]): [number, number][] {
  const found = ranged.series.find(({ name }) => name === series);
  if (found?.stamp_ms.length) return found.stamp_ms.map((stamp, i) => [stamp, found.mean[i]!]);
  return points.flatMap(([stamp, value]) => (value === null ? [] : [[stamp, value]]));
}
