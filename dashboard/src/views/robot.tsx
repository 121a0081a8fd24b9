/** The robot page: who it is and how its link is, then its live cards or its topics. */

import { useSignal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { api, ApiError } from "../api/client";
import { can } from "../api/session";
import type { Robot, SeriesInfo, Topic } from "../api/types";
import { moment } from "../history/moment";
import { ageText, now } from "../live/age";
import { concerns, health, robots } from "../live/fleet";
import { SEALED_CDR } from "../seal/encoding";
import { useLive } from "../ui/context";
import { bytes, bytesPerSecond, fixed, integer } from "../ui/format";
import { Link, StateBadge } from "../ui/parts";
import { place, setParam } from "../ui/url";
import { lazy } from "./lazy";

const LiveTab = lazy(async () => (await import("./live")).LiveTab);
const TimeBar = lazy(async () => (await import("./live")).TimeBar, null);
const LinkTab = lazy(async () => (await import("./link")).LinkTab);
const TopicsTab = lazy(async () => (await import("./topics")).TopicsTab);
const GraphTab = lazy(async () => (await import("./graph")).GraphTab);
const NodesTab = lazy(async () => (await import("../nodes/nodes")).NodesTab);
const ConfigTab = lazy(async () => (await import("../twin/config")).ConfigTab);
const CommandsTab = lazy(async () => (await import("./commands")).CommandsTab);
const PastTab = lazy(async () => (await import("./past")).PastTab);

const Unlock = lazy(async () => (await import("../seal/lock")).Unlock, null);
const RobotAlerts = lazy(async () => (await import("../alerts/on_robot")).RobotAlerts, <div class="alert-strip" />);

const REFRESH_MS = 2000;

/** The tabs that are about the robot alone: their words in the address, their names, what they need. */
const TABS: Record<string, { title: string; needs?: string; View: ComponentType<{ robot: Robot }> }> = {
  graph: { title: "Graph", View: GraphTab },
  link: { title: "Link", View: LinkTab },
  nodes: { title: "Nodes", needs: "nodes.read", View: NodesTab },
  config: { title: "Config", needs: "twin.read", View: ConfigTab },
  commands: { title: "Commands", needs: "commands.read", View: CommandsTab },
};

export function RobotPage({ id }: { id: string }) {
  const { stream } = useLive();
  const topics = useSignal<Topic[] | null>(null);
  const series = useSignal<SeriesInfo[]>([]);
  const problem = useSignal("");
  const hadAlerts = useSignal(false);
  const robot = robots.value?.find((candidate) => candidate.id === id);

  useEffect(() => {
    let gone = false;
    const refresh = async () => {
      if (stream.state.peek() !== "open" || document.hidden) return;
      try {
        const [found, names] = await Promise.all([api.topics(id), api.metrics(id)]);
        if (gone) return;
        topics.value = found;
        series.value = names;
        problem.value = "";
      } catch (error) {
        if (!gone) problem.value = error instanceof ApiError ? error.message : String(error);
      }
    };
    const timer = setInterval(() => void refresh(), REFRESH_MS);
    const stop = stream.state.subscribe((state) => {
      if (state === "open") void refresh();
    });
    return () => {
      gone = true;
      clearInterval(timer);
      stop();
    };
  }, [id]);

  const open = robot?.alerts.open ?? 0;
  const reads = can("alerts.read");
  useEffect(() => {
    if (reads && !hadAlerts.peek()) void api.hadAlerts(id).then((had) => (hadAlerts.value = had), () => {}); // marks of the past are no reason to complain
  }, [id, open, reads]);

  useEffect(() => {
    document.querySelector(".tabs [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" }); // a phone does not show all of them
  }, [place.value.params.get("tab"), robot === undefined, topics.value === null]);

  if (!robot) return <Unknown id={id} loading={robots.value === null} />;
  const asked = place.value.params.get("tab");
  const own = asked !== null && Object.hasOwn(TABS, asked) ? TABS[asked]! : null;
  const tab = own ? asked! : asked === "topics" ? "topics" : "live";
  return (
    <>
      <Header robot={robot} />
      {(open > 0 || hadAlerts.value) && reads && <RobotAlerts key={id} robot={id} counts={robot.alerts} />}
      <nav class="tabs" aria-label="Robot">
        <button type="button" aria-current={tab === "live" ? "page" : undefined} onClick={() => setParam("tab", "live", "live")}>{moment.value === null ? "Live" : "Past"}</button>
        <button type="button" aria-current={tab === "topics" ? "page" : undefined} onClick={() => setParam("tab", "topics", "live")}>
          Topics <small>{topics.value?.length ?? ""}</small>
        </button>
        {Object.entries(TABS).filter(([, { needs }]) => !needs || can(needs)).map(([word, { title }]) => (
          <button key={word} type="button" aria-current={tab === word ? "page" : undefined} onClick={() => setParam("tab", word, "live")}>{title}</button>
        ))}
      </nav>
      {problem.value && <p class="problem" role="status">{problem.value}</p>}
      {tab === "live" && <TimeBar key={id} robot={id} />}
      {!own && topics.value?.some(({ encoding }) => encoding === SEALED_CDR) && <Unlock />}
      {tab === "live" && moment.value !== null ? (
        <PastTab key={`past ${id}`} robot={robot} series={series.value} />
      ) : tab === "live" ? (
        <LiveTab key={`live ${id}`} robot={robot} topics={topics.value} series={series.value} />
      ) : tab === "topics" ? (
        <TopicsTab robot={robot} topics={topics.value} />
      ) : (
        own && <own.View key={`${tab} ${id}`} robot={robot} />
      )}
    </>
  );
}

function Header({ robot }: { robot: Robot }) {
  const at = now.value;
  const online = robot.state === "online";
  const since = robot.since ? ageText(at - Date.parse(robot.since)) : "";
  const facts: [string, string][] = [
    [online ? "up" : "offline for", since],
    ["rtt", online ? fixed(robot.link.rtt_ms, 1, "ms") : ""],
    ["uplink", online ? bytesPerSecond(robot.link.bytes_per_s) : ""],
    ["outbox", online && robot.link.outbox_bytes > 0 ? bytes(robot.link.outbox_bytes) : ""],
    ["lost", robot.counts.lost > 0 ? integer(robot.counts.lost) : ""],
    ["namespace", robot.namespace],
    ["agent", robot.agent_version],
  ];
  return (
    <header class="robot-head">
      <p class="crumb"><Link href="/">Fleet</Link> /</p>
      <h1>{robot.id}</h1>
      <StateBadge state={health(robot, at)} note={concerns(robot, at).join(", ")} />
      <dl>
        {facts.filter(([, value]) => value !== "").map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd class="num">{value}</dd>
          </div>
        ))}
      </dl>
    </header>
  );
}

function Unknown({ id, loading }: { id: string; loading: boolean }) {
  if (loading) return <p class="quiet">Waiting for the gateway…</p>;
  return (
    <section class="empty">
      <h1>No robot “{id}”</h1>
      <p>It has never been linked to this gateway.</p>
      <p><Link href="/">All robots</Link></p>
    </section>
  );
}
