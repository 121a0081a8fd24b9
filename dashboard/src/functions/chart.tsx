/** A function over time: calls with what failed of them, and under it how long the slowest twentieth took. */

import { useSignal } from "@preact/signals";
import type { Stats } from "../api/functions";
import { now } from "../live/age";
import { clockTime, integer } from "../ui/format";
import { roundTop, slots, type Slot } from "./series";
import { milliseconds } from "./words";

const WIDTH = 600;
const HIGH = 120;
const LOW = 60;
const TICKS = 4;

export function FunctionChart({ stats }: { stats: Stats }) {
  const pointed = useSignal<number | null>(null);
  const places = slots(stats, now.value, stats.window_s > 3600 ? 3 : 1);
  const step = WIDTH / places.length;
  const top = roundTop(Math.max(...places.map(({ invocations, throttles }) => invocations + throttles)));
  const slowest = roundTop(Math.max(...places.map(({ p95Ms }) => p95Ms ?? 0)));
  const at = pointed.value === null ? null : places[Math.min(pointed.value, places.length - 1)]!;
  const point = (event: { currentTarget: Element; clientX: number }) => {
    const box = event.currentTarget.getBoundingClientRect();
    pointed.value = Math.max(0, Math.min(places.length - 1, Math.floor(((event.clientX - box.left) / box.width) * places.length)));
  };
  const onKey = (event: KeyboardEvent) => {
    const by = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
    if (by === 0) return;
    event.preventDefault();
    pointed.value = Math.max(0, Math.min(places.length - 1, (pointed.value ?? places.length) + by));
  };
  const cursor = at && <line class="chart-cursor" x1={(places.indexOf(at) + 0.5) * step} x2={(places.indexOf(at) + 0.5) * step} y1="0" y2={HIGH} />;
  return (
    <section class="card card-chart" aria-label="Calls over time">
      <header>
        <h2>Calls</h2>
        <p class="chart-said num" role="status">{at ? <Said at={at} /> : <Legend />}</p>
      </header>
      <div class="chart" tabIndex={0} role="img" aria-label={`${integer(stats.invocations)} calls, ${integer(stats.errors)} failed, p95 ${milliseconds(stats.p95_ms)}`} onPointerMove={point} onPointerLeave={() => (pointed.value = null)} onKeyDown={onKey} onBlur={() => (pointed.value = null)}>
        <span class="chart-top num">{integer(top)}<small>/{stats.window_s > 3600 ? "3 min" : "min"}</small></span>
        <svg viewBox={`0 0 ${WIDTH} ${HIGH}`} preserveAspectRatio="none" class="chart-calls" aria-hidden="true">
          <Grid height={HIGH} />
          {places.map((slot, i) => <Bars key={slot.atMs} slot={slot} x={i * step} width={step} top={top} />)}
          {cursor}
        </svg>
        <span class="chart-top num">{milliseconds(slowest)}<small> p95</small></span>
        <svg viewBox={`0 0 ${WIDTH} ${LOW}`} preserveAspectRatio="none" class="chart-slow" aria-hidden="true">
          <Grid height={LOW} />
          {places.map(({ atMs, p95Ms }, i) => p95Ms !== null && <line key={atMs} class="chart-p95" x1={i * step} x2={(i + 1) * step} y1={LOW - (p95Ms / slowest) * (LOW - 3) - 1} y2={LOW - (p95Ms / slowest) * (LOW - 3) - 1} />)}
          {cursor}
        </svg>
        <p class="chart-ticks num" aria-hidden="true">
          {Array.from({ length: TICKS + 1 }, (_, i) => <span key={i}>{i === TICKS ? "now" : clockTime(places[Math.round((i * (places.length - 1)) / TICKS)]!.atMs).slice(0, 5)}</span>)}
        </p>
      </div>
    </section>
  );
}

const Grid = ({ height }: { height: number }) => (
  <g class="chart-grid">{[0.5, height / 2, height - 0.5].map((y) => <line key={y} x1="0" x2={WIDTH} y1={y} y2={y} />)}</g>
);

function Bars({ slot: { invocations, errors, throttles }, x, width, top }: { slot: Slot; x: number; width: number; top: number }) {
  const bar = (kind: string, from: number, count: number) =>
    count > 0 && <rect class={`trend-${kind}`} x={x + width * 0.1} width={width * 0.8} y={HIGH - ((from + count) / top) * (HIGH - 1)} height={Math.max(1.5, (count / top) * (HIGH - 1))} />;
  return <>{bar("error", 0, errors)}{bar("ok", errors, invocations - errors)}{bar("throttle", invocations, throttles)}</>;
}

const Said = ({ at }: { at: Slot }) => (
  <>
    <b>{clockTime(at.atMs).slice(0, 5)}</b> {integer(at.invocations)} call{at.invocations === 1 ? "" : "s"}
    {at.errors > 0 && <span class="bad">, {integer(at.errors)} failed</span>}
    {at.throttles > 0 && <>, {integer(at.throttles)} throttled</>}
    {at.p95Ms !== null && <>, p95 {milliseconds(at.p95Ms)}</>}
  </>
);

const Legend = () => (
  <>
    <i class="key-ok" /> went well <i class="key-error" /> failed <i class="key-throttle" /> throttled
  </>
);
