/** A function's last hour at a glance: a bar for each two minutes, its foot red where calls failed. */

import type { Stats } from "../api/functions";
import { now } from "../live/age";
import { slots } from "./series";

const WIDTH = 120;
const HEIGHT = 24;
const BARS = 30;

export function Trend({ stats }: { stats: Stats }) {
  const bars = slots(stats, now.value, stats.window_s / 60 / BARS);
  const top = Math.max(...bars.map(({ invocations, throttles }) => invocations + throttles), 1);
  const step = WIDTH / bars.length;
  const bar = (kind: string, i: number, from: number, count: number) =>
    count > 0 && <rect key={`${kind}${i}`} class={`trend-${kind}`} x={i * step} width={step * 0.72} y={HEIGHT - ((from + count) / top) * (HEIGHT - 2) - 1} height={Math.max(1, (count / top) * (HEIGHT - 2))} />;
  return (
    <svg class="trend" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" aria-hidden="true">
      <line x1="0" x2={WIDTH} y1={HEIGHT - 0.5} y2={HEIGHT - 0.5} />
      {bars.map(({ invocations, errors, throttles }, i) => [bar("error", i, 0, errors), bar("ok", i, errors, invocations - errors), bar("throttle", i, invocations, throttles)])}
    </svg>
  );
}
