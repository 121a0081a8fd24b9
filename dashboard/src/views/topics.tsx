/** The topics tab: what the robot publishes, how much of it, and what reached the gateway. */

import type { Robot, Topic } from "../api/types";
import { SEALED_CDR } from "../seal/envelope";
import { LockMark } from "../seal/lock";
import { bytesPerSecond, fixed, integer, NONE, relativeTopic, typeWord } from "../ui/format";

export function TopicsTab({ robot, topics }: { robot: Robot; topics: Topic[] | null }) {
  if (topics === null) return <p class="quiet">Reading the robot's topics…</p>;
  const sorted = [...topics].sort((a, b) => a.topic.localeCompare(b.topic));
  return (
    <div class="scroll">
      <table class="topics">
        <thead>
          <tr>
            <th scope="col">Topic</th>
            <th scope="col">Class</th>
            <th scope="col" class="end">Rate</th>
            <th scope="col" class="end">Bandwidth</th>
            <th scope="col" class="end">On robot</th>
            <th scope="col" class="end">Received</th>
            <th scope="col" class="end">Lost</th>
            <th scope="col" class="end">Watched</th>
          </tr>
        </thead>
        <tbody>
          {sorted.map((topic) => (
            <tr key={`${topic.topic} ${topic.type}`} data-topic={topic.topic}>
              <td title={topic.type}>
                <span class="mono">{relativeTopic(topic.topic, robot.namespace)}</span>
                {topic.encoding === SEALED_CDR && <LockMark />}
                <span class="sub">{typeWord(topic.type)}</span>
              </td>
              <td><span class={`chip chip-${topic.class}`}>{topic.forward ? topic.class : "kept on robot"}</span></td>
              <td class="end num">{fixed(topic.rate_hz, 1, "Hz")}</td>
              <td class="end num">{bytesPerSecond(topic.bytes_per_s)}</td>
              <td class="end num">
                {integer(topic.messages)}
                {topic.thinned > 0 && <span class="sub">{integer(topic.thinned)} thinned</span>}
              </td>
              <td class="end num">{integer(topic.received)}</td>
              <td class={topic.lost > 0 ? "end num bad" : "end num"}>{integer(topic.lost)}</td>
              <td class="end num">{topic.demand_hz ? fixed(topic.demand_hz, 0, "Hz") : NONE}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
