/** Facts about the chosen node or topic, with links to more. */

import type { RobotGraph } from "../api/introspect";
import type { Robot, Topic } from "../api/types";
import { qosOf } from "../topics/qos";
import { bytesPerSecond, fixed, relativeTopic } from "../ui/format";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";

interface FactsProps {
  robot: Robot;
  graph: RobotGraph;
  topics: ReadonlyMap<string, Topic>;
  /** The id of a vertex. */
  chosen: string;
  onClose: () => void;
}

export function Facts({ robot, graph, topics, chosen, onClose }: FactsProps) {
  const [kind, name] = [chosen.slice(0, chosen.indexOf(" ")), chosen.slice(chosen.indexOf(" ") + 1)];
  return (
    <aside class="card graph-facts" aria-label={`${kind} ${name}`} data-facts={name}>
      <header>
        <h2 class="mono">{relativeTopic(name, robot.namespace)}</h2>
        <span class="note">{kind}</span>
        <button type="button" class="unset" aria-label="Close" onClick={onClose}>×</button>
      </header>
      {kind === "topic" ? <TopicFacts robot={robot} graph={graph} topics={topics} name={name} /> : <NodeFacts robot={robot} graph={graph} name={name} />}
    </aside>
  );
}

function TopicFacts({ robot, graph, topics, name }: Omit<FactsProps, "chosen" | "onClose"> & { name: string }) {
  const found = graph.topics.find(({ topic }) => topic === name);
  const told = topics.get(name);
  if (!found) return <p class="hint">It is gone.</p>;
  return (
    <div class="graph-about">
      <p class="mono">{found.types.join(", ")}</p>
      {told && <p>{fixed(told.rate_hz, 1, "Hz")} · {bytesPerSecond(told.bytes_per_s)}</p>}
      <Names title="Published by" names={found.publishers.map(({ node, qos }) => [node || "a node outside", qosOf(qos)?.short ?? ""])} robot={robot} />
      <Names title="Subscribers" names={found.subscribers.map(({ node, qos }) => [node || "a node outside", qosOf(qos)?.short ?? ""])} robot={robot} />
      {told && <p><Link class="text-link" href={`${robotHref(robot.id)}?tab=topics&topic=${encodeURIComponent(name)}`}>See its messages</Link></p>}
    </div>
  );
}

function NodeFacts({ robot, graph, name }: { robot: Robot; graph: RobotGraph; name: string }) {
  const uses = (ends: "publishers" | "subscribers") => graph.topics.filter((topic) => topic[ends].some(({ node }) => node === name)).map(({ topic }): [string, string] => [topic, ""]);
  const serves = graph.services.filter(({ servers }) => servers.some(({ node }) => node === name)).map(({ service }): [string, string] => [service, ""]);
  const calls = graph.services.filter(({ clients }) => clients.some(({ node }) => node === name)).map(({ service }): [string, string] => [service, ""]);
  const actions = graph.actions.filter(({ servers }) => servers.includes(name)).map(({ action, type }): [string, string] => [action, type]);
  return (
    <div class="graph-about">
      <Names title="Publishes" names={uses("publishers")} robot={robot} />
      <Names title="Hears" names={uses("subscribers")} robot={robot} />
      <Names title="Serves" names={serves} robot={robot} />
      <Names title="Calls" names={calls} robot={robot} />
      <Names title="Actions" names={actions} robot={robot} />
    </div>
  );
}

function Names({ title, names, robot }: { title: string; names: [string, string][]; robot: Robot }) {
  if (names.length === 0) return null;
  return (
    <section>
      <h3>{title} <small>{names.length}</small></h3>
      <ul>{names.map(([name, more], i) => <li key={i}><span class="mono">{relativeTopic(name, robot.namespace)}</span>{more && <span class="sub">{more}</span>}</li>)}</ul>
    </section>
  );
}
