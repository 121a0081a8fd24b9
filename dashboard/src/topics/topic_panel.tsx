/** One topic looked at closely: its newest message, publishing on it, who is at its ends, what it is made of. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { ComponentType } from "preact";
import { saidOf } from "../api/client";
import { introspectApi, type Endpoint, type RobotGraph, type TypeShape } from "../api/introspect";
import type { Robot, Topic } from "../api/types";
import { bytes, clockTime, integer, relativeTopic } from "../ui/format";
import { place, setParam } from "../ui/url";
import { MessageView } from "./message_view";
import { PublishForm } from "./publish_form";
import { qosOf } from "./qos";

export interface PanelProps {
  robot: Robot;
  topic: Topic;
  graph: RobotGraph | null;
}

const VIEWS: Record<string, { title: string; View: ComponentType<PanelProps> }> = {
  message: { title: "Message", View: MessageView },
  publish: { title: "Publish", View: PublishForm },
  ends: { title: "Publishers and subscribers", View: EndsView },
  type: { title: "Type", View: TypeView },
};

export function TopicPanel(props: PanelProps) {
  const asked = place.value.params.get("view") ?? "message";
  const word = Object.hasOwn(VIEWS, asked) ? asked : "message";
  const { View } = VIEWS[word]!;
  return (
    <div class="topic-panel" data-panel={props.topic.topic}>
      <nav class="tabs" aria-label={props.topic.topic}>
        {Object.entries(VIEWS).map(([key, { title }]) => (
          <button key={key} type="button" aria-current={key === word ? "page" : undefined} onClick={() => setParam("view", key, "message")}>{title}</button>
        ))}
      </nav>
      <div class="topic-view" data-view={word}><View {...props} /></div>
    </div>
  );
}

function EndsView({ robot, topic, graph }: PanelProps) {
  const found = graph?.topics.find((one) => one.topic === topic.topic);
  const facts: [string, string][] = [
    ["type hash", topic.type_hash],
    ["encoding", topic.encoding],
    ["came here", `${integer(topic.received)} messages, ${bytes(topic.received_bytes)}`],
    ["newest", topic.last_stamp_ms === null ? "" : clockTime(topic.last_stamp_ms)],
    ["dropped on the robot", topic.dropped > 0 ? integer(topic.dropped) : ""],
    ["stored", topic.class !== "live" ? "every message" : topic.history_hz > 0 ? `${topic.history_hz} a second` : "none of it"],
    ...(qosOf(topic.qos)?.rows ?? []),
  ];
  return (
    <div class="ends">
      {found ? (
        <>
          <Ends title="Publishers" ends={found.publishers} robot={robot} />
          <Ends title="Subscribers" ends={found.subscribers} robot={robot} />
        </>
      ) : (
        <p class="hint">{topic.publishers} publishers and {topic.subscribers} subscribers. Which nodes they are, this robot's agent does not tell.</p>
      )}
      <dl class="ends-facts">
        {facts.filter(([, value]) => value !== "").map(([name, value]) => (
          <div key={name}><dt>{name}</dt><dd class="mono">{value}</dd></div>
        ))}
      </dl>
    </div>
  );
}

function Ends({ title, ends, robot }: { title: string; ends: Endpoint[]; robot: Robot }) {
  return (
    <section>
      <h3>{title} <small>{ends.length}</small></h3>
      {ends.length === 0 ? <p class="hint">none</p> : (
        <ul>
          {ends.map(({ node, qos }, i) => (
            <li key={i}>
              <span class="mono">{node === "" ? "a node outside the robot's namespace" : relativeTopic(node, robot.namespace)}</span>
              <span class="sub">{qosOf(qos)?.short ?? ""}</span>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

function TypeView({ robot, topic: { type } }: PanelProps) {
  const shape = useSignal<TypeShape | null>(null);
  const problem = useSignal("");
  useEffect(() => {
    introspectApi.shape(robot.id, type).then((found) => (shape.value = found), (error: unknown) => (problem.value = saidOf(error)));
  }, [robot.id, type]);
  if (problem.value) return <p class="problem">{problem.value}</p>;
  return (
    <div class="type-view">
      <p class="mono"><b>{type}</b></p>
      {shape.value ? <pre>{shape.value.text || "# no fields"}</pre> : <p class="hint">Reading it…</p>}
    </div>
  );
}
