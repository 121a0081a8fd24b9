/** The Graph page of the fleet: every robot's graph at a glance, those with worries first. */

import { useMemo } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { introspectApi } from "../api/introspect";
import type { RobotGraph } from "../api/introspect";
import { curve, layout } from "../graph/layout";
import { drawn } from "../graph/model";
import { robots } from "../live/fleet";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";
import "../ui/admin.css";
import "../ui/ops.css";
import "../ui/topics.css";

const LOOK_MS = 5000;

export function GraphsPage() {
  const asked = useAsked(() => introspectApi.graphs(), LOOK_MS);
  const found = asked.value.value;
  if (!found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Reading the robots' graphs…</p>;
  const worried = found.map((graph) => ({ graph, worries: drawnOf(graph).worries.length })).sort((a, b) => b.worries - a.worries || a.graph.robot.localeCompare(b.graph.robot, "en", { numeric: true }));
  const many = worried.filter(({ worries }) => worries > 0).length;
  return (
    <>
      <div class="page-head">
        <h1>Graph</h1>
        <p class="counts">
          <span><b>{found.length}</b> {found.length === 1 ? "robot" : "robots"}</span>
          {many > 0 && <span class="count-attention"><b>{many}</b> with something that does not get through</span>}
        </p>
      </div>
      {found.length === 0 && <p class="nothing">No robot has told its graph so far.</p>}
      <ul class="graph-cards">
        {worried.map(({ graph, worries }) => <GraphCard key={graph.robot} graph={graph} worries={worries} />)}
      </ul>
    </>
  );
}

const namespaceOf = (id: string) => robots.value?.find((robot) => robot.id === id)?.namespace ?? "/";
const drawnOf = (graph: RobotGraph) => drawn(graph, { namespace: namespaceOf(graph.robot), plumbing: false, wanted: "" });

function GraphCard({ graph, worries }: { graph: RobotGraph; worries: number }) {
  const offline = robots.value?.find((robot) => robot.id === graph.robot)?.state !== "online";
  return (
    <li class={offline ? "card graph-card row-stale" : "card graph-card"} data-robot={graph.robot}>
      <header>
        <h2><Link class="robot-link" href={`${robotHref(graph.robot)}?tab=graph`}>{graph.robot}</Link></h2>
        <span class="note">{graph.nodes.length} nodes · {graph.topics.length} topics · {graph.services.length} services{offline ? " · offline" : ""}</span>
      </header>
      <Small graph={graph} />
      {worries > 0 && <p class="graph-worry">{worries} {worries === 1 ? "worry" : "worries"}</p>}
    </li>
  );
}

function Small({ graph }: { graph: RobotGraph }) {
  const { vertices, edges, placed } = useMemo(() => {
    const parts = drawnOf(graph);
    return { ...parts, placed: layout(parts.vertices, parts.edges) };
  }, [graph.revision, graph.robot]);
  return (
    <svg class="graph graph-small" viewBox={`-4 -4 ${placed.width + 8} ${placed.height + 8}`} preserveAspectRatio="xMidYMid meet" aria-hidden="true">
      {edges.map((edge, i) => <path key={i} class={edge.broken ? "graph-edge graph-broken" : "graph-edge"} d={curve(placed.lines[i]!)} stroke-width="3" />)}
      {vertices.map(({ id, kind }) => {
        const { x, y, width, height } = placed.at.get(id)!;
        return <rect key={id} class={`graph-mini graph-mini-${kind}`} x={x - width / 2} y={y - height / 2} width={width} height={height} rx={kind === "node" ? 6 : height / 2} />;
      })}
    </svg>
  );
}
