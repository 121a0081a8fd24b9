/** Waves as bars: what is done, in flight, failed and waiting, by colour, by pattern, and in words. */

import type { Rollout, Wave } from "../api/rollouts";
import { allowedOf, partsOf, partsText, type Part } from "./words";

const SHORTEST = 6; // percent: of one robot among thousands there is still something to see

/** One bar; each part is as wide as its robots are many, and none that is there is too narrow to be seen. */
function Bar({ parts, label, share = 1 }: { parts: Part[]; label: string; share?: number }) {
  return (
    <span class="wave-bar" role="img" aria-label={label} style={{ inlineSize: `${Math.max(SHORTEST, 100 * share)}%` }}>
      {parts.filter(({ count }) => count > 0).map(({ name, count }) => <i key={name} class={`part-${name}`} style={{ flexGrow: count }} />)}
    </span>
  );
}

/** All waves beside each other, each as wide as it is large: for a list. */
export function WaveStrip({ rollout }: { rollout: Rollout }) {
  return (
    <div class="wave-strip" data-waves={rollout.waves.length}>
      {rollout.waves.map((wave) => (
        <div key={wave.wave} class="wave-cell" style={{ flexGrow: Math.sqrt(wave.size) }} aria-current={isAt(rollout, wave) ? "step" : undefined}>
          <Bar parts={partsOf(wave)} label={`Wave ${wave.wave}: ${partsText(partsOf(wave))}`} />
        </div>
      ))}
    </div>
  );
}

/** A row for each wave: for the page of one rollout. */
export function WaveRows({ rollout }: { rollout: Rollout }) {
  const largest = Math.max(...rollout.waves.map(({ size }) => size));
  return (
    <ol class="wave-rows" aria-label="Waves">
      {rollout.waves.map((wave) => {
        const parts = partsOf(wave);
        const text = partsText(parts);
        const allowed = allowedOf(rollout.max_failure_rate, wave.size);
        return (
          <li key={wave.wave} data-wave={wave.wave} aria-current={isAt(rollout, wave) ? "step" : undefined}>
            <span class="wave-name"><b>Wave {wave.wave}</b> <small class="num">{wave.size.toLocaleString("en")}</small></span>
            <Bar parts={parts} label={`Wave ${wave.wave}: ${text}`} share={wave.size / largest} />
            <span class="wave-said" aria-hidden="true">{text}</span>
            <small class="wave-bound">{allowed === 0 ? "none may fail" : `at most ${allowed} may fail`}</small>
          </li>
        );
      })}
    </ol>
  );
}

const isAt = (rollout: Rollout, { wave }: Wave) => wave === rollout.wave && (rollout.state === "running" || rollout.state === "paused" || rollout.state === "halted");

/** What colours and patterns mean. */
export function WaveLegend() {
  return (
    <p class="wave-legend">
      <i class="part-done" /> done <i class="part-flight" /> in flight <i class="part-failed" /> failed <i class="part-waiting" /> waiting
    </p>
  );
}
