/** The fleet page: one line of counts, a search, and every robot worst first. */

import { useMemo } from "preact/hooks";
import type { Robot } from "../api/types";
import { ageText, isStale, now } from "../live/age";
import { concerns, cpuSpark, health, latest, robots, worstFirst, type Health } from "../live/fleet";
import { bytes, bytesPerSecond, fixed, NONE, percent } from "../ui/format";
import { Link, Spark, StateBadge } from "../ui/parts";
import { place, robotHref, setParam } from "../ui/url";

export function FleetPage() {
  const all = robots.value;
  const at = now.value;
  const query = place.value.params.get("q") ?? "";
  const sorted = useMemo(() => worstFirst(all ?? [], at), [all, at]);
  if (all === null) return <p class="quiet">Waiting for the gateway…</p>;
  if (all.length === 0) return <EmptyFleet />;
  const shown = sorted.filter((robot) => matches(robot, query, at));
  return (
    <>
      <div class="page-head">
        <Counts robots={all} at={at} />
        <label class="search">
          <span class="visually-hidden">Search robots</span>
          <input
            type="search"
            placeholder="Search   /"
            value={query}
            onInput={(event) => setParam("q", event.currentTarget.value)}
          />
        </label>
      </div>
      <table class="fleet">
        <thead>
          <tr>
            <th scope="col">State</th>
            <th scope="col">Robot</th>
            <th scope="col">Alerts</th>
            <th scope="col" class="end">Battery</th>
            <th scope="col" class="end">Speed</th>
            <th scope="col" class="end">CPU</th>
            <th scope="col" class="end">Link</th>
            <th scope="col" class="end">Uplink</th>
            <th scope="col" class="end">Outbox</th>
            <th scope="col" class="end">Last seen</th>
          </tr>
        </thead>
        <tbody>
          {shown.map((robot) => (
            <Row key={robot.id} robot={robot} at={at} />
          ))}
        </tbody>
      </table>
      {shown.length === 0 && <p class="quiet">No robot matches “{query}”.</p>}
    </>
  );
}

function matches(robot: Robot, query: string, at: number): boolean {
  const text = [robot.id, robot.namespace, robot.hostname, health(robot, at), ...Object.entries(robot.labels).flat()];
  return query
    .toLowerCase()
    .split(/\s+/)
    .every((word) => text.join(" ").toLowerCase().includes(word));
}

function Counts({ robots: list, at }: { robots: Robot[]; at: number }) {
  const counts: Record<Health, number> = { online: 0, attention: 0, offline: 0 };
  for (const robot of list) counts[health(robot, at)] += 1;
  const uplink = list.reduce((sum, robot) => sum + (robot.state === "online" ? robot.link.bytes_per_s : 0), 0);
  return (
    <p class="counts" data-counts={JSON.stringify(counts)} aria-live="polite">
      <span><b>{list.length}</b> {list.length === 1 ? "robot" : "robots"}</span>
      <span class="count-online"><b>{counts.online + counts.attention}</b> online</span>
      {counts.attention > 0 && <span class="count-attention"><b>{counts.attention}</b> need attention</span>}
      {counts.offline > 0 && <span class="count-offline"><b>{counts.offline}</b> offline</span>}
      <span class="num">{bytesPerSecond(uplink)}</span>
    </p>
  );
}

function Row({ robot, at }: { robot: Robot; at: number }) {
  const state = health(robot, at);
  const problems = concerns(robot, at);
  const seenMs = robot.last_seen ? Date.parse(robot.last_seen) : null;
  const offline = robot.state !== "online";
  return (
    <tr data-robot={robot.id} class={offline ? "row-stale" : undefined}>
      <td class="cell-state"><StateBadge state={state} note={problems.join(", ")} /></td>
      <td class="cell-name">
        <Link href={robotHref(robot.id)} class="robot-link">{robot.id}</Link>
        <span class="sub">{problems.length > 0 ? problems.join(", ") : describe(robot)}</span>
      </td>
      <td class="cell-alerts" data-label="Alerts"><AlertBadge robot={robot} /></td>
      <td class="end cell-value" data-label="Battery"><Battery robot={robot.id} at={at} offline={offline} /></td>
      <td class="end cell-value" data-label="Speed"><Value robot={robot.id} series="odom.twist.twist.linear.x" at={at} offline={offline} text={(v) => fixed(v, 2, "m/s")} /></td>
      <td class="end cell-value" data-label="CPU"><Cpu robot={robot.id} at={at} offline={offline} /></td>
      <td class="end num" data-label="Link">{offline ? NONE : fixed(robot.link.rtt_ms, 1, "ms")}</td>
      <td class="end num" data-label="Uplink">{offline ? NONE : bytesPerSecond(robot.link.bytes_per_s)}</td>
      <td class="end num" data-label="Outbox">{offline ? NONE : bytes(robot.link.outbox_bytes)}</td>
      <td class="end num" data-label="Last seen">{offline && seenMs ? `${ageText(at - seenMs)} ago` : seenMs ? "now" : NONE}</td>
    </tr>
  );
}

/** How many alerts of it are open, as bad as the worst of them. */
function AlertBadge({ robot: { id, alerts } }: { robot: Robot }) {
  if (alerts.open === 0) return <span class="none">{NONE}</span>;
  const worst = alerts.error > 0 ? "error" : alerts.warning > 0 ? "warning" : "info";
  return (
    <Link href={`/alerts?robot=${encodeURIComponent(id)}`} class={`alert-badge alert-badge-${worst}`}>
      <svg viewBox="0 0 12 12" aria-hidden="true"><path d={WORST[worst]} /></svg>
      {alerts.open}<span class="visually-hidden"> open, the worst: {worst}</span>
    </Link>
  );
}

const WORST = { error: "M3.800.5h4.400l3.300 3.300v4.400l-3.300 3.300H3.800L.5 8.200V3.800Z", warning: "M6 .8 11.600 11H.4Z", info: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z" };

const describe = (robot: Robot) => [robot.hostname, `${robot.channels} topics`].filter(Boolean).join(" · ");

interface CellProps {
  robot: string;
  at: number;
  offline: boolean;
}

/** A number that turns grey and says its age when it is late. */
function Value({ robot, series, at, offline, text }: CellProps & { series: string; text: (value: number) => string }) {
  const sample = latest(robot, series).value;
  if (!sample) return <span class="none">{NONE}</span>;
  const stale = offline || isStale(sample.stamp_ms, at);
  return (
    <span class={stale ? "num stale" : "num"} data-series={series} data-value={sample.value} data-stale={stale || undefined}>
      {text(sample.value)}
      {stale && <small> {ageText(at - sample.stamp_ms)}</small>}
    </span>
  );
}

function Battery(props: CellProps) {
  const sample = latest(props.robot, "battery_state.percentage").value;
  const level = sample ? Math.max(0, Math.min(1, sample.value)) : 0;
  return (
    <span class="with-bar">
      {sample && (
        <span class={`bar ${level < 0.2 ? "bar-bad" : ""}`} aria-hidden="true">
          <i style={{ transform: `scaleX(${level})` }} />
        </span>
      )}
      <Value {...props} series="battery_state.percentage" text={percent} />
    </span>
  );
}

function Cpu(props: CellProps) {
  return (
    <span class="with-bar">
      <Spark values={cpuSpark(props.robot).value} top={100} />
      <Value {...props} series="host.cpu.percent" text={(value) => fixed(value, 0, "%")} />
    </span>
  );
}

function EmptyFleet() {
  return (
    <section class="empty">
      <h1>No robots yet</h1>
      <p>The gateway is up and waits for the first one. Start a robot, or three simulated ones:</p>
      <pre>metaros up --robots 3{"\n"}metaros agent --name my_robot --gateway 127.0.0.1:8081</pre>
      <p>It appears here by itself.</p>
    </section>
  );
}
