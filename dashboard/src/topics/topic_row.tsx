/** One topic of the table: what goes through it, and how it leaves the robot. */

import type { Robot, Topic } from "../api/types";
import { SEALED_CDR } from "../seal/encoding";
import { LockMark } from "../seal/lock";
import { bytesPerSecond, fixed, integer, NONE, relativeTopic, typeWord } from "../ui/format";
import { Spark } from "../ui/parts";
import { qosOf } from "./qos";
import { topOf } from "./rates";

interface TopicRowProps {
  robot: Robot;
  topic: Topic;
  rates: number[];
  chosen: boolean;
  onChoose: () => void;
}

export function TopicRow({ robot, topic, rates, chosen, onChoose }: TopicRowProps) {
  const qos = qosOf(topic.qos);
  return (
    <tr data-topic={topic.topic} aria-selected={chosen} class={robot.state === "online" ? undefined : "row-stale"}>
      <td class="cell-name">
        <button type="button" class="node-name mono" aria-expanded={chosen} onClick={onChoose}>{relativeTopic(topic.topic, robot.namespace)}</button>
        {topic.encoding === SEALED_CDR && <LockMark />}
        <span class="sub" title={topic.type}>{typeWord(topic.type)}</span>
      </td>
      <td data-label="Class"><Way topic={topic} /></td>
      <td class="end" data-label="Rate">
        <span class="with-spark">
          <Spark values={rates} top={topOf(rates)} />
          <span class="num">{fixed(topic.rate_hz, 1, "Hz")}</span>
        </span>
      </td>
      <td class="end num" data-label="Bandwidth">{bytesPerSecond(topic.bytes_per_s)}</td>
      <td class="cell-qos" data-label="QoS" title={qos?.rows.map(([name, value]) => `${name}: ${value}`).join("\n")}>{qos?.short ?? <span class="none">{NONE}</span>}</td>
      <td class="end num" data-label="Pub → sub" title={`${topic.publishers} publishers, ${topic.subscribers} subscribers`}>{topic.publishers} → {topic.subscribers}</td>
      <td class="end num" data-label="Received">
        {integer(topic.received)}
        {topic.lost > 0 && <span class="sub bad">{integer(topic.lost)} lost</span>}
        {topic.thinned > 0 && <span class="sub">{integer(topic.thinned)} thinned</span>}
      </td>
      <td class="end num" data-label="Watched">{topic.demand_hz === null ? NONE : topic.demand_hz === 0 ? "all" : fixed(topic.demand_hz, 0, "Hz")}</td>
    </tr>
  );
}

const WAYS: Record<Topic["class"], string> = {
  event: "each one, first",
  metric: "each one, stored",
  bulk: "each one, when there is room",
  live: "while somebody watches",
};

function Way({ topic }: { topic: Topic }) {
  if (!topic.forward) return <span class="chip">kept on robot</span>;
  return <span class={`chip chip-${topic.class}`} title={WAYS[topic.class]}>{topic.class}</span>;
}
