/** The link tab: how the robot is connected, what waits on it, what was lost, and how much may be sent. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { ApiError } from "../api/client";
import { robotApi } from "../api/robot";
import type { Gap, Robot } from "../api/types";
import { HISTORY_POINTS, linkHistory } from "../live/link_history";
import { GapsCard } from "../panels/time_bar/gaps";
import { BackfillCard, QueueCard } from "../panels/uplink/queues";
import { UplinkCard } from "../panels/uplink/uplink";
import { useLive } from "../ui/context";
import { bytesPerSecond, duration, fixed, integer, NONE } from "../ui/format";
import { Card } from "../ui/parts";

const REFRESH_MS = 3000;
const NEWEST = 20;

export function LinkTab({ robot }: { robot: Robot }) {
  const history = linkHistory(robot.id);
  const gaps = useGaps(robot.id);
  return (
    <div class="link-grid">
      <ConnectionCard robot={robot} rtts={history.rtts.value} />
      <div class="link-side">
        <BackfillCard robot={robot} drained={history.drained.value} />
        <UplinkCard robot={robot} />
      </div>
      <QueueCard robot={robot} />
      <GapsCard robot={robot} gaps={gaps.found} />
      {gaps.problem && <p class="problem" role="status">{gaps.problem}</p>}
    </div>
  );
}

function useGaps(robot: string): { found: Gap[] | null; problem: string } {
  const { stream } = useLive();
  const found = useSignal<Gap[] | null>(null);
  const problem = useSignal("");
  useEffect(() => {
    let gone = false;
    const refresh = async () => {
      if (stream.state.peek() !== "open" || document.hidden) return;
      try {
        const gaps = await robotApi.gaps(robot, NEWEST);
        if (gone) return;
        found.value = gaps;
        problem.value = "";
      } catch (error) {
        if (!gone) problem.value = error instanceof ApiError ? error.message : String(error);
      }
    };
    void refresh();
    const timer = setInterval(() => void refresh(), REFRESH_MS);
    return () => {
      gone = true;
      clearInterval(timer);
    };
  }, [robot]);
  return { found: found.value, problem: problem.value };
}

const TRANSPORTS: Record<string, string> = { grpc: "gRPC", websocket: "WebSocket" };

function ConnectionCard({ robot, rtts }: { robot: Robot; rtts: number[] }) {
  const { link } = robot;
  const online = robot.state === "online";
  const offsetS = link.clock_offset_ms / 1000;
  const facts: [string, string, boolean][] = [
    ["Transport", [TRANSPORTS[link.transport] ?? link.transport, link.gateway].filter(Boolean).join(" · ") || NONE, false],
    ["Sends", online ? bytesPerSecond(link.sent_bytes_per_s) : NONE, false],
    ["Arrives", online ? bytesPerSecond(link.bytes_per_s) : NONE, false],
    ["Reconnects", integer(link.reconnects), false],
    ["Robot's clock", clockWords(offsetS), Math.abs(offsetS) > 1],
    ["Resent, dropped here", integer(robot.counts.duplicates), false],
    ["Outboxes so far", integer(link.epochs), false],
    ["Copies found out", link.forks > 0 ? integer(link.forks) : "none", link.forks > 0],
  ];
  return (
    <Card title="Connection" kind="connection" note={online ? "linked" : "no link"}>
      <div class="connection" data-rtt={link.rtt_ms ?? ""} data-transport={link.transport}>
        <div class="rtt">
          <p class="big">{online ? fixed(link.rtt_ms, 1, "ms") : NONE} <span class="uplink-state">round trip</span></p>
          <RttLine values={online ? rtts : []} />
        </div>
        <dl>
          {facts.map(([name, value, worry]) => (
            <div key={name}><dt>{name}</dt><dd class={worry ? "num bad" : "num"}>{value}</dd></div>
          ))}
        </dl>
      </div>
    </Card>
  );
}

function clockWords(offsetS: number): string {
  if (Math.abs(offsetS) < 0.5) return "agrees";
  return offsetS > 0 ? `${duration(offsetS)} slow` : `${duration(-offsetS)} fast`;
}

/** The last two minutes; the top is the largest of them, at least 10 ms. */
function RttLine({ values }: { values: number[] }) {
  if (values.length < 2) return <svg class="rtt-line" viewBox="0 0 240 56" aria-hidden="true" />;
  const top = Math.max(10, ...values);
  const at = (value: number, i: number) =>
    `${(240 - (values.length - 1 - i) * (240 / (HISTORY_POINTS - 1))).toFixed(1)},${(54 - (50 * value) / top).toFixed(1)}`;
  const line = values.map(at).join(" ");
  const first = at(values[0]!, 0).split(",")[0];
  return (
    <svg class="rtt-line" viewBox="0 0 240 56" preserveAspectRatio="none" role="img" aria-label={`Round trip, at most ${fixed(top, 1, "ms")}`}>
      <polygon points={`${first},56 ${line} 240,56`} />
      <polyline points={line} />
    </svg>
  );
}
