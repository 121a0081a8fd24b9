/** An open tree: the newest message of its topic. */

import { useSignal, type Signal } from "@preact/signals";
import type { Missing } from "../api/history_types";
import { Absent } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import { treeRows, type Row } from "./tree_rows";

const RATE_HZ = 4;

export function TreeBody({ robot, topic, received }: { robot: string; topic: string; received: Signal<number | null> }) {
  const rows = useSignal<Row[]>([]);
  const error = useSignal("");
  const missing = useSignal<Missing | null>(null);
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    received.value = null;
    if (absent) rows.value = [];
  };
  useTopic({ robot, topic, maxRateHz: RATE_HZ, onInstant: begin }, (decoded, seenMs) => {
    error.value = decoded.message ? "" : (decoded.error ?? "");
    if (decoded.message) rows.value = treeRows(decoded.message);
    received.value = seenMs;
  });
  return (
    <>
      {missing.value && <Absent missing={missing.value} />}
      {error.value && <p class="problem">{error.value}</p>}
      <dl class="mono">
        {rows.value.map((row, i) => (
          <div key={i} style={{ paddingInlineStart: `${row.depth * 14}px` }}>
            <dt>{row.name}</dt>
            <dd>{row.value}</dd>
          </div>
        ))}
      </dl>
    </>
  );
}
