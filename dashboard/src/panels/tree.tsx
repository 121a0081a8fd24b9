/** Any other type: names and values. Watched only while open, so that a closed card costs the robot's link nothing. */

import { useSignal } from "@preact/signals";
import type { Missing } from "../api/history_types";
import { short, typeWord } from "../ui/format";
import { Absent, Freshness } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import { treeRows, type Row } from "./tree_rows";

const RATE_HZ = 4;

export function TreeCard({ robot, topic, title, type, rateHz }: { robot: string; topic: string; title: string; type: string; rateHz: number | null }) {
  const open = useSignal(false);
  const rows = useSignal<Row[]>([]);
  const error = useSignal("");
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    received.value = null;
    if (absent) rows.value = [];
  };
  useTopic({ robot, topic, maxRateHz: RATE_HZ, enabled: open.value, onInstant: begin }, (decoded, seenMs) => {
    error.value = decoded.message ? "" : (decoded.error ?? "");
    if (decoded.message) rows.value = treeRows(decoded.message);
    received.value = seenMs;
  });
  return (
    <details
      class="card tree"
      data-card="tree"
      data-topic={topic}
      onToggle={(event) => {
        open.value = event.currentTarget.open;
      }}
    >
      <summary>
        <span class="mono">{title}</span>
        <span class="note">
          {typeWord(type)} {rateHz !== null && rateHz > 0 && `· ${short(Number(rateHz.toFixed(1)))} Hz`}
        </span>
        {open.value && <Freshness receivedMs={received.value} />}
      </summary>
      {open.value && missing.value && <Absent missing={missing.value} />}
      {error.value && <p class="problem">{error.value}</p>}
      <dl class="mono">
        {rows.value.map((row, i) => (
          <div key={i} style={{ paddingInlineStart: `${row.depth * 14}px` }}>
            <dt>{row.name}</dt>
            <dd>{row.value}</dd>
          </div>
        ))}
      </dl>
    </details>
  );
}
