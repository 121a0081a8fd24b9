/** One node looked at closely: its log, its parameters, its lifecycle, how it crashed. */

import { useSignal } from "@preact/signals";
import type { ComponentType } from "preact";
import type { Node } from "../api/nodes";
import { can } from "../api/session";
import { place, setParam } from "../ui/url";
import { CrashesView } from "./crashes";
import { LifecycleView } from "./lifecycle";
import { LogView } from "./log_view";
import { SIGNALS } from "./node_words";
import { ParametersView } from "./parameters";

const VIEWS: Record<string, { title: string; View: ComponentType<{ node: Node }> }> = {
  log: { title: "Log", View: LogView },
  parameters: { title: "Parameters", View: ParametersView },
  lifecycle: { title: "Lifecycle", View: LifecycleView },
  crashes: { title: "Crashes", View: CrashesView },
};

export function NodePanel({ node, onSignal }: { node: Node; onSignal: (signal: number) => void }) {
  const asked = place.value.params.get("view") ?? "log";
  const word = Object.hasOwn(VIEWS, asked) ? asked : "log";
  const { View } = VIEWS[word]!;
  const crashes = node.reported?.crashes ?? 0;
  return (
    <section class="card card-node" aria-labelledby="node-title" data-panel={node.name}>
      <header>
        <h2 id="node-title">{node.name}</h2>
        <span class="mono node-ros">{node.ros_name}</span>
        {can("nodes.control") && node.online && node.reported?.pid && <SignalField node={node} onSignal={onSignal} />}
        <button type="button" class="unset node-close" aria-label={`Close ${node.name}`} onClick={() => setParam("node", "")}>×</button>
      </header>
      <nav class="tabs node-tabs" aria-label={node.name}>
        {Object.entries(VIEWS).map(([key, { title }]) => (
          <button key={key} type="button" aria-current={key === word ? "page" : undefined} onClick={() => setParam("view", key, "log")}>
            {title} {key === "crashes" && crashes > 0 && <small class="num">{crashes}</small>}
          </button>
        ))}
      </nav>
      <div class="node-view" data-view={word}><View key={`${node.robot} ${node.name}`} node={node} /></div>
    </section>
  );
}

function SignalField({ node, onSignal }: { node: Node; onSignal: (signal: number) => void }) {
  const chosen = useSignal(SIGNALS[0]![1]);
  return (
    <span class="signal">
      <select class="text" aria-label={`Signal for ${node.name}`} value={String(chosen.value)} onChange={(event) => (chosen.value = Number(event.currentTarget.value))}>
        {SIGNALS.map(([word, number]) => <option key={number} value={number}>{word}</option>)}
      </select>
      <button type="button" class="button" onClick={() => onSignal(chosen.value)}>Send signal</button>
    </span>
  );
}
