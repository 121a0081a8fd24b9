/** The Graph tab of a robot: its nodes and topics, what flows between them, and what cannot. */

import { useSignal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { api } from "../api/client";
import { introspectApi } from "../api/introspect";
import type { Robot } from "../api/types";
import { Facts } from "../graph/facts";
import { GraphSvg } from "../graph/graph_svg";
import { drawn, PLUMBING } from "../graph/model";
import { relativeTopic } from "../ui/format";
import { place, setParam } from "../ui/url";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/topics.css";

export { GraphsPage } from "./graphs"; // one file to fetch

const LOOK_MS = 3000;

export function GraphTab({ robot }: { robot: Robot }) {
  const asked = useAsked(() => introspectApi.graph(robot.id), LOOK_MS);
  const told = useAsked(() => api.topics(robot.id), LOOK_MS);
  const plumbing = useSignal(false);
  const wanted = useSignal("");
  const graph = asked.value.value;
  const topics = useMemo(() => new Map((told.value.value ?? []).map((topic) => [topic.topic, topic])), [told.value.value]);
  // The same revision is the same drawing: it does not move under the pointer.
  const found = useMemo(() => graph && drawn(graph, { namespace: robot.namespace, plumbing: plumbing.value, wanted: wanted.value }), [graph?.revision, plumbing.value, wanted.value]);
  if (!graph || !found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Reading the robot's graph…</p>;
  if (graph.revision === 0) return <p class="nothing">This robot has not reported its graph: its agent is too old for it, or has just connected.</p>;
  const chosen = place.value.params.get("at") ?? "";
  const there = found.vertices.some(({ id }) => id === chosen) ? chosen : "";
  const choose = (id: string) => setParam("at", id);
  const hidden = graph.topics.filter(({ topic }) => PLUMBING.test(topic)).length;
  return (
    <div class="ops graph-tab">
      <div class="topics-head">
        <p class="counts">
          <span><b>{graph.nodes.length}</b> {graph.nodes.length === 1 ? "node" : "nodes"}</span>
          <span><b>{graph.topics.length}</b> topics</span>
          <span><b>{graph.services.length}</b> services</span>
          <span><b>{graph.actions.length}</b> {graph.actions.length === 1 ? "action" : "actions"}</span>
        </p>
        {hidden > 0 && <label class="check"><input type="checkbox" checked={plumbing.value} onChange={(event) => (plumbing.value = event.currentTarget.checked)} /> rosout and the like</label>}
        <label class="search"><span class="visually-hidden">Search nodes and topics</span><input type="search" placeholder="Node or topic" value={wanted.value} onInput={(event) => (wanted.value = event.currentTarget.value)} /></label>
      </div>
      {robot.state !== "online" && <p class="hint">The robot is offline: this is what it reported last.</p>}
      {found.problems.length > 0 && (
        <ul class="graph-problems" aria-label="Problems">
          {found.problems.map(({ topic, text }) => (
            <li key={`${topic} ${text}`}><button type="button" class="mono" onClick={() => choose(`topic ${topic}`)}>{relativeTopic(topic, robot.namespace)}</button> {text}</li>
          ))}
        </ul>
      )}
      {found.vertices.length === 0 ? <p class="nothing">Nothing is called so.</p> : (
        <div class={there ? "graph-stage graph-stage-split" : "graph-stage"}>
          <div class="graph-scroll" tabIndex={0} role="region" aria-label="Graph"><GraphSvg drawn={found} topics={topics} chosen={there} onChoose={choose} label={`Nodes and topics of ${robot.id}`} /></div>
          {there && <Facts robot={robot} graph={graph} topics={topics} chosen={there} onClose={() => choose("")} />}
        </div>
      )}
      {found.alone.length > 0 && <p class="hint">Without a topic here: <span class="mono">{found.alone.map((name) => relativeTopic(name, robot.namespace)).join(", ")}</span></p>}
      {found.waiting.length > 0 && <p class="hint" data-waiting>Subscribed, but published by nobody now: <span class="mono">{found.waiting.map((name) => relativeTopic(name, robot.namespace)).join(", ")}</span></p>}
      <Legend />
    </div>
  );
}

function Legend() {
  return (
    <p class="graph-legend hint" aria-label="Legend">
      <span><i class="legend-node" /> node</span>
      <span><i class="legend-topic" /> topic</span>
      <span><i class="legend-line" /> as wide as its traffic</span>
      <span><i class="legend-still" /> nothing flows</span>
      <span><i class="legend-broken" /> cannot get through</span>
    </p>
  );
}
