/** What of a robot's graph is drawn: nodes and topics as vertices, publishing and subscribing as arrows, and what looks wrong. */

import type { Endpoint, GraphTopic, RobotGraph } from "../api/introspect";
import { relativeTopic } from "../ui/format";
import { qosOf } from "../topics/qos";

export interface Vertex {
  id: string;
  kind: "node" | "topic";
  /** Its full name. */
  name: string;
  label: string;
  width: number;
  height: number;
}

export interface Edge {
  from: string;
  to: string;
  topic: string;
  /** Why nothing gets through, or "". */
  broken: string;
}

export interface Drawn {
  vertices: Vertex[];
  edges: Edge[];
  /** Nodes that neither publish nor subscribe to anything that is drawn. */
  alone: string[];
  /** What does not get through, and why. */
  problems: Problem[];
  /** Topics that somebody hears and nobody publishes. That is no problem: a base waits for commands most of its life. */
  waiting: string[];
}

export interface Problem {
  topic: string;
  text: string;
}

/** Topics that nearly every node has: they would hide the rest. */
export const PLUMBING = /(^|\/)(rosout|parameter_events|clock|diagnostics_agg)$/;
const LETTER = 7.3;
const MOST_LETTERS = 30;
const HEIGHT = 30;
/** How a node is called that is not one of the robot's own. */
export const OUTSIDE = "outside";

export interface GraphFilter {
  namespace: string;
  plumbing: boolean;
  /** Only what has this in its name, and its neighbours. */
  wanted: string;
}

export function drawn(graph: RobotGraph, { namespace, plumbing, wanted }: GraphFilter): Drawn {
  const word = wanted.trim().toLowerCase();
  const shown = graph.topics.filter((topic) => (plumbing || !PLUMBING.test(topic.topic)) && matches(topic, word));
  const vertices = new Map<string, Vertex>();
  const edges = new Map<string, Edge>();
  const vertex = (kind: Vertex["kind"], name: string) => {
    const id = `${kind} ${name}`;
    if (!vertices.has(id)) vertices.set(id, sized(id, kind, name, namespace));
    return id;
  };
  const edge = (from: string, to: string, topic: string, broken: string) => {
    const key = `${from} > ${to}`;
    if (!edges.get(key)?.broken) edges.set(key, { from, to, topic, broken });
  };
  for (const { topic, publishers, subscribers } of shown) {
    const id = vertex("topic", topic);
    for (const { node } of publishers) edge(vertex("node", node || OUTSIDE), id, topic, "");
    for (const one of subscribers) edge(id, vertex("node", one.node || OUTSIDE), topic, publishers.length > 0 ? whyBroken(publishers, one) : "");
  }
  const alone = graph.nodes.filter((node) => !vertices.has(`node ${node}`) && node.toLowerCase().includes(word));
  return { vertices: [...vertices.values()], edges: [...edges.values()], alone, problems: shown.flatMap(problemsOf), waiting: shown.filter(waits).map(({ topic }) => topic) };
}

const matches = ({ topic, publishers, subscribers }: GraphTopic, word: string) =>
  word === "" || topic.toLowerCase().includes(word) || [...publishers, ...subscribers].some(({ node }) => node.toLowerCase().includes(word));

function sized(id: string, kind: Vertex["kind"], name: string, namespace: string): Vertex {
  const whole = name === OUTSIDE ? "other nodes" : relativeTopic(name, namespace);
  const label = whole.length > MOST_LETTERS ? `…${whole.slice(1 - MOST_LETTERS)}` : whole;
  return { id, kind, name, label, width: Math.round(label.length * LETTER + 28), height: HEIGHT };
}

/** Why none of the publishers reaches a subscriber: by type, or by ROS 2's rules of offered and requested QoS. */
export function whyBroken(publishers: readonly Endpoint[], subscriber: Endpoint): string {
  const reasons = publishers.map((publisher) => {
    if (publisher.type !== subscriber.type) return `it is ${publisher.type} there`;
    if (publisher.type_hash && subscriber.type_hash && publisher.type_hash !== subscriber.type_hash) return "the type is defined otherwise there";
    const [offered, asked] = [qosOf(publisher.qos)?.rows, qosOf(subscriber.qos)?.rows].map((rows) => Object.fromEntries(rows ?? []));
    if (offered!.reliability === "best effort" && asked!.reliability === "reliable") return "best effort is offered, reliable is asked for";
    if (offered!.durability === "volatile" && asked!.durability === "transient local") return "volatile is offered, transient local is asked for";
    return "";
  });
  return reasons.every(Boolean) ? (reasons[0] ?? "") : "";
}

const waits = ({ topic, publishers, subscribers }: GraphTopic) => publishers.length === 0 && subscribers.length > 0 && !PLUMBING.test(topic);

function problemsOf({ topic, publishers, subscribers }: GraphTopic): Problem[] {
  if (publishers.length === 0) return [];
  return subscribers.flatMap((one) => {
    const why = whyBroken(publishers, one);
    return why ? [{ topic, text: `${one.node || "a node outside"} hears nothing: ${why}` }] : [];
  });
}
