/** Any other type: names and values. Watched only while open, so that a closed card costs the robot's link nothing. */

import { useSignal } from "@preact/signals";
import { short, typeWord } from "../ui/format";
import { Freshness } from "../ui/parts";
import { lazy } from "../views/lazy";

const TreeBody = lazy(async () => (await import("./tree_body")).TreeBody, null);

export function TreeCard({ robot, topic, title, type, rateHz }: { robot: string; topic: string; title: string; type: string; rateHz: number | null }) {
  const open = useSignal(false);
  const received = useSignal<number | null>(null);
  return (
    <details
      class="card tree"
      data-card="tree"
      data-topic={topic}
      onToggle={(event) => {
        open.value = event.currentTarget.open;
        received.value = null;
      }}
    >
      <summary>
        <span class="mono">{title}</span>
        <span class="note">
          {typeWord(type)} {rateHz !== null && rateHz > 0 && `· ${short(Number(rateHz.toFixed(1)))} Hz`}
        </span>
        {open.value && <Freshness receivedMs={received.value} />}
      </summary>
      {open.value && <TreeBody robot={robot} topic={topic} received={received} />}
    </details>
  );
}
