/** What waits on the robot, class by class, against its quota; and how the back-fill goes. */

import type { ClassDepth, Robot } from "../../api/types";
import type { Drained } from "../../live/drain";
import { bytes, bytesPerSecond, duration, integer, NONE } from "../../ui/format";
import { Card } from "../../ui/parts";

const WORDS: Record<ClassDepth["name"], string> = {
  event: "faults, logs, results: all others yield to them",
  metric: "series of numbers: thinned when full",
  bulk: "scans, images, clips: oldest dropped when full",
  live: "what somebody watches: newest only",
};

export function QueueCard({ robot }: { robot: Robot }) {
  const { classes, disk_free_bytes: free } = robot.link;
  return (
    <Card title="Waiting on the robot" kind="queues" note={free > 0 ? `${bytes(free)} of disk free` : ""}>
      {classes.length === 0 ? <p class="quiet">The agent has not said yet.</p> : (
        <dl class="queues">
          {classes.map((one) => <Queue key={one.name} depth={one} />)}
        </dl>
      )}
      <p class="legend hint"><i class="fresh" /> since the link is up <i class="late" /> from an outage</p>
    </Card>
  );
}

function Queue({ depth }: { depth: ClassDepth }) {
  const waits = depth.fresh_bytes + depth.backfill_bytes;
  const share = (part: number) => (part > 0 ? Math.min(100, Math.max(0.8, (100 * part) / Math.max(depth.quota_bytes, 1))) : 0);
  return (
    <div data-class={depth.name} data-waits={waits}>
      <dt><b>{depth.name}</b> <small>{WORDS[depth.name] ?? ""}</small></dt>
      <dd>
        <span class="queue-bar" role="img" aria-label={`${bytes(waits)} of ${bytes(depth.quota_bytes)}`}>
          <i class="fresh" style={{ inlineSize: `${share(depth.fresh_bytes)}%` }} />
          <i class="late" style={{ inlineSize: `${share(depth.backfill_bytes)}%` }} />
        </span>
        <span class="queue-facts num">
          <span><b>{waits > 0 ? bytes(waits) : NONE}</b> of {bytes(depth.quota_bytes)}</span>
          <span>{depth.samples > 0 ? `${integer(depth.samples)} samples` : ""}</span>
          <span class={depth.lost > 0 && depth.name !== "live" ? "bad" : undefined}>
            {depth.lost > 0 ? `${integer(depth.lost)} ${depth.name === "live" ? "dropped" : "lost"}` : ""}
          </span>
        </span>
      </dd>
    </div>
  );
}

export function BackfillCard({ robot, drained }: { robot: Robot; drained: Drained }) {
  const online = robot.state === "online";
  const { leftBytes, peakBytes, progress, bytesPerS, etaS } = drained;
  return (
    <Card title="Back-fill" kind="backfill" note={leftBytes > 0 && online ? bytesPerSecond(bytesPerS) : ""}>
      <div class="backfill" data-left={leftBytes} data-progress={progress.toFixed(3)}>
        {leftBytes === 0 ? (
          <>
            <p class="big">{online ? "Up to date" : "Offline"}</p>
            <p class="hint">{online ? "Nothing of an outage waits on the robot." : "What it accepts now follows when it is back."}</p>
          </>
        ) : (
          <>
            <p class="big">{bytes(leftBytes)} <span class="uplink-state">of {bytes(peakBytes)} left</span></p>
            <div class="meter meter-late" role="progressbar" aria-valuenow={Math.round(progress * 100)} aria-valuemin={0} aria-valuemax={100}>
              <i style={{ transform: `scaleX(${progress})` }} />
            </div>
            <p class="hint">{etaS === null ? "It waits for fresh data, or for the gateway." : `Done in about ${duration(etaS)}. Fresh data goes first.`}</p>
          </>
        )}
      </div>
    </Card>
  );
}
