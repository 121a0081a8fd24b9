/** The robot's devices and their status: a row a device, from its diagnostics, the worst first. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Robot } from "../api/types";
import { STALE_AFTER_MS } from "../live/age";
import { useLive } from "../ui/context";
import { Card } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import type { CardProps } from "./card_props";
import { DeviceRow } from "./device_row";
import { DevicesModel, type Device } from "./devices_model";
import "../styles/devices.css";

/** Every device's message counts: none gives way to a newer one of another. */
const DEPTH = 128;
/** Rows are drawn at most so often. */
const DRAW_MS = 200;
/** In the past: devices that said something in so many seconds before. The history thins what many say. */
const BACK_S = 10;

export function DevicesCard({ robot, topics }: CardProps) {
  const { at, past } = useLive();
  const model = useMemo(() => new DevicesModel(), [robot.id]);
  const version = useSignal(0);
  const timer = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  const problem = useSignal("");
  useEffect(() => () => clearTimeout(timer.current), []);
  const changed = () => {
    timer.current ??= setTimeout(() => {
      timer.current = undefined;
      version.value += 1;
    }, DRAW_MS);
  };
  const hear = (message: object, seenMs: number) => {
    model.add(message, seenMs);
    changed();
  };
  const forget = () => {
    model.clear();
    changed();
  };
  void version.value;
  const rows = model.rows(at.value, past ? BACK_S * 1000 : STALE_AFTER_MS);
  return (
    <Card title="Devices" kind="devices" note={rows.length > 0 ? summary(rows) : past ? "" : "waiting…"}>
      {topics.map(({ topic }) => (
        <Listener key={topic} robot={robot} topic={topic} onMessage={hear} onInstant={forget} onProblem={(words) => (problem.value = words)} />
      ))}
      {problem.value && <p class="problem">{problem.value}</p>}
      {rows.length === 0 && past && <p class="hint pad-in">No device said anything here.</p>}
      <div class="devices">
        {rows.map((device) => <DeviceRow key={device.name} device={device} namespace={robot.namespace} atMs={at.value} />)}
      </div>
      {model.refused.size > 0 && <p class="hint pad-in">More devices than fit here: {model.refused.size} are not shown.</p>}
    </Card>
  );
}

interface ListenerProps {
  robot: Robot;
  topic: string;
  onMessage: (message: object, seenMs: number) => void;
  onInstant: () => void;
  onProblem: (words: string) => void;
}

function Listener({ robot, topic, onMessage, onInstant, onProblem }: ListenerProps) {
  useTopic({ robot: robot.id, topic, depth: DEPTH, backS: BACK_S, onInstant }, ({ message, error }, seenMs) => {
    onProblem(message ? "" : (error ?? ""));
    if (message) onMessage(message, seenMs);
  });
  return null;
}

const FINE = new Set<string>(["working", "ok", "resting"]);

/** "5 devices, 1 waiting": how many, and how those stand that are not well. */
function summary(rows: Device[]): string {
  const counts = new Map<string, number>();
  for (const { state } of rows) if (!FINE.has(state)) counts.set(state, (counts.get(state) ?? 0) + 1);
  const ill = [...counts].map(([state, count]) => `${count} ${state}`);
  return [`${rows.length} ${rows.length === 1 ? "device" : "devices"}`, ...ill].join(" · ");
}
