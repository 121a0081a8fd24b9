/** The topics tab: everything that flows through the robot, each topic looked at closely, the services and actions below. */

import { useSignal } from "@preact/signals";
import { Fragment } from "preact";
import { useEffect, useMemo } from "preact/hooks";
import { useAsked } from "../admin/use_list";
import { introspectApi, type RobotGraph } from "../api/introspect";
import type { Robot, Topic } from "../api/types";
import { Actions } from "../topics/actions";
import { OpenInFoxglove } from "../topics/foxglove";
import { Rates } from "../topics/rates";
import { Services } from "../topics/services";
import { TopicPanel } from "../topics/topic_panel";
import { TopicRow } from "../topics/topic_row";
import { bytesPerSecond } from "../ui/format";
import { place, setParam } from "../ui/url";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/nodes.css";
import "../styles/topics.css";

const LOOK_MS = 3000;
const COLUMNS = 8;

export function TopicsTab({ robot, topics }: { robot: Robot; topics: Topic[] | null }) {
  const rates = useMemo(() => new Rates(), [robot.id]);
  const asked = useAsked<RobotGraph>(() => introspectApi.graph(robot.id), LOOK_MS);
  const wanted = useSignal("");
  useMemo(() => topics && rates.add(topics), [topics]);
  const chosen = place.value.params.get("topic");
  useEffect(() => {
    document.querySelector(".topics [aria-selected=true]")?.scrollIntoView({ block: "nearest" }); // where an address leads
  }, [topics === null]);
  if (topics === null) return <p class="quiet">Reading the robot's topics…</p>;
  const word = wanted.value.trim().toLowerCase();
  const shown = topics.filter(({ topic, type }) => topic.toLowerCase().includes(word) || type.toLowerCase().includes(word)).sort((a, b) => a.topic.localeCompare(b.topic));
  const graph = asked.value.value;
  return (
    <div class="ops topics-tab">
      <div class="topics-head">
        <Totals topics={topics} />
        <OpenInFoxglove robot={robot.id} />
        <label class="search"><span class="visually-hidden">Search topics, services and actions</span><input type="search" placeholder="Topic, type, service, action" value={wanted.value} onInput={(event) => (wanted.value = event.currentTarget.value)} /></label>
      </div>
      {shown.length === 0 ? <p class="nothing">{topics.length === 0 ? "This robot has announced no topics." : "No topic is called so."}</p> : (
        <div class="scroll">
          <table class="topics">
            <thead>
              <tr>
                <th scope="col">Topic</th>
                <th scope="col">Class</th>
                <th scope="col" class="end">Rate</th>
                <th scope="col" class="end">Bandwidth</th>
                <th scope="col">QoS</th>
                <th scope="col" class="end" title="Publishers and subscribers on the robot">Pub → sub</th>
                <th scope="col" class="end">Received</th>
                <th scope="col" class="end" title="What the robot was asked to send of it">Watched</th>
              </tr>
            </thead>
            <tbody>
              {shown.map((topic) => {
                const open = topic.topic === chosen;
                return (
                  <Fragment key={`${topic.topic} ${topic.type}`}>
                    <TopicRow robot={robot} topic={topic} rates={rates.of(topic)} chosen={open} onChoose={() => setParam("topic", open ? "" : topic.topic)} />
                    {open && <tr class="topic-open"><td colSpan={COLUMNS}><TopicPanel robot={robot} topic={topic} graph={graph} /></td></tr>}
                  </Fragment>
                );
              })}
            </tbody>
          </table>
        </div>
      )}
      <Services robot={robot} graph={graph} wanted={word} />
      <Actions robot={robot} graph={graph} wanted={word} />
    </div>
  );
}

function Totals({ topics }: { topics: Topic[] }) {
  const flowing = topics.filter(({ rate_hz: rate }) => (rate ?? 0) > 0);
  const all = flowing.reduce((sum, { bytes_per_s: size }) => sum + (size ?? 0), 0);
  return (
    <p class="counts">
      <span><b>{topics.length}</b> {topics.length === 1 ? "topic" : "topics"}</span>
      <span><b>{flowing.length}</b> flowing</span>
      <span><b>{bytesPerSecond(all)}</b> on the robot</span>
      <span><b>{topics.filter(({ demand_hz: demand }) => demand !== null).length}</b> watched</span>
    </p>
  );
}
