/** The losses a robot declared, newest first, with the reason in words. */

import type { Gap, Robot } from "../../api/types";
import { ageText, now } from "../../live/age";
import { integer, relativeTopic } from "../../ui/format";
import { Card } from "../../ui/parts";
import { reasonWords } from "../../ui/reasons";

export function GapsCard({ robot, gaps }: { robot: Robot; gaps: Gap[] | null }) {
  const { lost } = robot.counts;
  return (
    <Card title="Declared losses" kind="gaps" note={lost > 0 ? `${integer(lost)} samples since the gateway started` : ""}>
      {gaps === null ? <p class="hint pad-in">Asking the store…</p> : gaps.length === 0 ? (
        <p class="hint pad-in">None. Every sample that the robot accepted is stored, or waits above.</p>
      ) : (
        <div class="scroll">
          <table class="gaps">
            <thead>
              <tr>
                <th scope="col">Declared</th>
                <th scope="col">Stream</th>
                <th scope="col" class="end">Samples</th>
                <th scope="col">Numbers</th>
                <th scope="col">Reason</th>
              </tr>
            </thead>
            <tbody>
              {gaps.map((gap) => <Row key={`${gap.stream} ${gap.epoch} ${gap.from}`} gap={gap} robot={robot} />)}
            </tbody>
          </table>
        </div>
      )}
    </Card>
  );
}

function Row({ gap, robot }: { gap: Gap; robot: Robot }) {
  const name = gap.topic ? relativeTopic(gap.topic, robot.namespace) : gap.class === "metric" ? "metric rows" : `stream ${gap.stream}`;
  return (
    <tr data-reason={gap.reason}>
      <td class="num" title={gap.declared}>{ageText(now.value - Date.parse(gap.declared))} ago</td>
      <td title={`epoch ${gap.epoch}`}>
        <span class={gap.topic ? "mono" : undefined}>{name}</span>
        {gap.backfill && <span class="sub">from an outage</span>}
      </td>
      <td class="end num bad">{integer(gap.count)}</td>
      <td class="num">{gap.from === gap.to ? integer(gap.from) : `${integer(gap.from)} – ${integer(gap.to)}`}</td>
      <td>{reasonWords(gap.reason)}</td>
    </tr>
  );
}
