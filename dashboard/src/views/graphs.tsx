/** The Graph page of the fleet: every robot's graph at a glance, those with problems first. */

import { useMemo } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { introspectApi } from "../api/introspect";
import type { RobotGraph } from "../api/introspect";
import { curve, layout } from "../graph/layout";
import { drawn, type Problem } from "../graph/model";
import { robots } from "../live/fleet";
import { relativeTopic } from "../ui/format";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/topics.css";

const LOOK_MS = 5000;
const SHOWN = 3; // problems of a card; the robot's own page has all

export function GraphsPage() {
  const asked = useAsked(() => introspectApi.graphs(), LOOK_MS);
  const found = asked.value.value;
  if (!found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Reading the robots' graphs…</p>;
  const cards = found.map((graph) => ({ graph, problems: drawnOf(graph).problems })).sort((a, b) => b.problems.length - a.problems.length || a.graph.robot.localeCompare(b.graph.robot, "en", { numeric: true }));
  const many = cards.filter(({ problems }) => problems.length > 0).length;
  return (
    <>
      <div class="page-head">
        <h1>Graph</h1>
        <p class="counts">
          <span><b>{found.length}</b> {found.length === 1 ? "robot" : "robots"}</span>
          {many > 0 ? <span class="count-attention"><b>{many}</b> with problems</span> : found.length > 0 && <span>no problems</span>}
        </p>
      </div>
      {found.length === 0 && <p class="nothing">No robot has reported its graph so far.</p>}
      <ul class="graph-cards">
        {cards.map(({ graph, problems }) => <GraphCard key={graph.robot} graph={graph} problems={problems} />)}
      </ul>
    </>
  );
}

const namespaceOf = (id: string) => robots.value?.find((robot) => robot.id === id)?.namespace ?? "/";
const drawnOf = (graph: RobotGraph) => drawn(graph, { namespace: namespaceOf(graph.robot), plumbing: false, wanted: "" });

function GraphCard({ graph, problems }: { graph: RobotGraph; problems: Problem[] }) {
  const namespace = namespaceOf(graph.robot);
  const more = problems.length - SHOWN;
  const offline = robots.value?.find((robot) => robot.id === graph.robot)?.state !== "online";
  return (
    <li class={offline ? "card graph-card row-stale" : "card graph-card"} data-robot={graph.robot}>
      <header>
        <h2><Link class="robot-link" href={`${robotHref(graph.robot)}?tab=graph`}>{graph.robot}</Link></h2>
        <span class="note">{graph.nodes.length} nodes · {graph.topics.length} topics · {graph.services.length} services{offline ? " · offline" : ""}</span>
      </header>
      <Small graph={graph} />
      {problems.length > 0 && (
        <ul class="graph-card-problems" aria-label="Problems">
          {problems.slice(0, SHOWN).map(({ topic, text }) => <li key={`${topic} ${text}`}><b class="mono">{relativeTopic(topic, namespace)}</b> {text}</li>)}
          {more > 0 && <li>and {more} more</li>}
        </ul>
      )}
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
