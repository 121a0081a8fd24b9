/** The plots of a robot: what the store remembers, continued by live values. */

import { signal, type Signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { Span } from "../../api/history_types";
import { useLive } from "../../ui/context";
import { Card } from "../../ui/parts";
import { plotsOf, type PlotSpec } from "./plot_table";
import { Plot } from "./plot";
import { Timeline } from "./timeline";

export const RANGES: Record<string, number> = { "5m": 300, "15m": 900, "1h": 3600, "6h": 21600 };
const POINTS = 400;
const LIVE_HZ = 2;

interface Track {
  spec: PlotSpec;
  timelines: Timeline[];
  version: Signal<number>;
  receivedMs: Signal<number | null>;
  /** What the robot declared lost. */
  holes: Signal<Span[]>;
}

function makeTracks(names: Set<string>, windowS: number): Track[] {
  return plotsOf(names).map((spec) => ({
    spec,
    timelines: spec.lines.map(() => new Timeline(windowS)),
    version: signal(0),
    receivedMs: signal<number | null>(null),
    holes: signal<Span[]>([]),
  }));
}

/** Each line of each track by its series' name. */
function* linesOf(tracks: Track[]) {
  for (const track of tracks) {
    for (const [i, line] of track.spec.lines.entries()) {
      yield { track, line, timeline: track.timelines[i]!, factor: line.factor ?? 1 };
    }
  }
}

async function loadHistory(robot: string, tracks: Track[], range: string): Promise<void> {
  const lines = [...linesOf(tracks)];
  const found = await api.range(robot, lines.map(({ line }) => line.series), `-${range}`, POINTS);
  const holes = (found.gaps ?? []).map(([from_ms, to_ms]) => ({ from_ms, to_ms }));
  for (const { track, line, timeline, factor } of lines) {
    track.holes.value = holes;
    const series = found.series.find(({ name }) => name === line.series);
    if (!series) continue;
    timeline.prepend(series.stamp_ms, series.mean.map((value) => value * factor), holes);
    track.version.value += 1;
    track.receivedMs.value ??= series.stamp_ms.at(-1) ?? null;
  }
}

export function MetricPlots({ robot, names, range }: { robot: string; names: string[]; range: string }) {
  const { stream } = useLive();
  const windowS = RANGES[range] ?? RANGES["5m"]!;
  const known = names.join("\n");
  const tracks = useMemo(() => makeTracks(new Set(names), windowS), [robot, known, windowS]);

  useEffect(() => {
    const lines = [...linesOf(tracks)];
    const series = lines.map(({ line }) => line.series);
    if (series.length === 0) return;
    const load = () => loadHistory(robot, tracks, range).catch((error: unknown) => console.warn(String(error)));
    void load();
    let wasOpen = stream.state.peek() === "open";
    const stopWatching = stream.state.subscribe((state) => {
      if (state === "open" && !wasOpen) void load();
      wasOpen = state === "open";
    });
    const stop = stream.metrics({ robots: robot, series, max_rate_hz: LIVE_HZ }, (_, stampMs, values) => {
      for (const { track, line, timeline, factor } of lines) {
        const value = values[line.series];
        if (value === undefined) continue;
        timeline.add(stampMs, value === null ? null : value * factor);
        track.version.value += 1;
        track.receivedMs.value = Date.now();
      }
    });
    return () => {
      stop();
      stopWatching();
    };
  }, [robot, tracks, range]);

  return (
    <>
      {tracks.map((track) => (
        <PlotCard key={`${track.spec.title} ${range}`} track={track} windowS={windowS} />
      ))}
    </>
  );
}

function PlotCard({ track, windowS }: { track: Track; windowS: number }) {
  const { spec } = track;
  return (
    <Card title={spec.title} kind="plot" topic={spec.lines[0]!.series} stampMs={track.receivedMs.value}>
      <Plot
        timelines={track.timelines}
        labels={spec.lines.map(({ label }) => label)}
        unit={spec.unit}
        digits={spec.digits}
        bounds={spec.bounds}
        windowS={windowS}
        version={track.version}
        holes={track.holes}
      />
    </Card>
  );
}
