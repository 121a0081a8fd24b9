/** Typed calls about a robot's nodes: how they do, what they said, start and stop, parameters and lifecycle. */

import type { Json, Numeric } from "../fleet_ops/json";
import type { Kind } from "../fleet_ops/values";
import { BASE_PATH, request, robotPath, send } from "./client";
import { askExact, sendExact } from "./exact";

export type NodeVerb = "start" | "stop" | "restart" | "retry" | "signal";

export interface NodeReport {
  state: string;
  why: string;
  pid: number | null;
  restarts: number;
  since: string | null;
  last_exit: string;
  version: string;
  waits_for: string[];
  lease_id: string;
  nice: number | null;
  quarantined: boolean;
  crashes: number;
  /** Of a critical node: how the safe stop goes that its death asked for; "" for none. */
  safe_stop: "" | "under way" | "done" | "failed";
  update: { state: string; version: string; code: string; message: string } | null;
}

/** A row of the robot's effective twin, with its defaults. */
export interface NodeRow {
  bundle: string;
  version: string;
  allowed: string;
  command: string[];
  restart: string;
  critical: boolean;
  nice: number;
  migratable: boolean;
  run: boolean;
}

export interface Node {
  robot: string;
  name: string;
  ros_name: string;
  online: boolean;
  state: string;
  wanted: "running" | "stopped" | "standby" | "absent";
  in_step: boolean;
  differs: { what: string; desired: unknown; reported: unknown; why: string }[];
  in_own: boolean;
  desired: NodeRow | null;
  reported: NodeReport | null;
  reported_at: string | null;
  holder: string | null;
}

export interface RobotNodes {
  robot: string;
  online: boolean;
  revision: number;
  applied: number;
  in_step: boolean;
  nodes: Node[];
}

export interface NodeResult {
  node: string;
  verb: NodeVerb;
  outcome: "done" | "pending" | "failed";
  told: boolean;
  message: string;
}

export interface LogLine {
  at: string | null;
  at_ns: string;
  text: string;
}

export interface LogPage {
  lines: LogLine[];
  cursor: string;
  more: boolean;
}

export interface Crash {
  at: string | null;
  reason: string;
  pid: number | null;
  ran_s: number | null;
  version: string;
  argv: string[];
  env: Record<string, string>;
  lines: string[];
}

interface Bounds {
  from: Numeric;
  to: Numeric;
  step: Numeric;
}

export interface Parameter {
  name: string;
  type: Kind | "not_set";
  value: Json;
  /** Where the twin names it. */
  desired?: Json;
  description: string;
  constraints: string;
  read_only: boolean;
  dynamic_typing: boolean;
  integer_range: Bounds | null;
  floating_point_range: Bounds | null;
}

export interface SetResult {
  name: string;
  successful: boolean;
  reason: string;
}

export interface Lifecycle {
  managed: boolean;
  state: string;
  wanted: string | null;
  transitions: string[];
}

const nodesPath = (robot: string) => `${robotPath(robot)}/nodes`;
const nodePath = (robot: string, node: string) => `${nodesPath(robot)}/${encodeURIComponent(node)}`;

export const nodesApi = {
  list: (robot: string) => request<RobotNodes>(nodesPath(robot)),
  act: (robot: string, node: string, verb: NodeVerb, signal?: number) =>
    send<NodeResult>("POST", `${nodePath(robot, node)}/${verb}`, signal === undefined ? {} : { signal }),
  log: (robot: string, node: string, query: Record<string, string>) => request<LogPage>(`${nodePath(robot, node)}/log?${new URLSearchParams(query)}`),
  /** For an EventSource: `lines` as they come, `end` with a code and why. */
  tailUrl: (robot: string, node: string, query: Record<string, string>) => `${BASE_PATH}${nodePath(robot, node)}/log/tail?${new URLSearchParams(query)}`,
  crashes: async (robot: string, node: string) => (await request<{ crashes: Crash[] }>(`${nodePath(robot, node)}/crashes`)).crashes,
  parameters: async (robot: string, node: string) => (await askExact<{ parameters: Parameter[] }>(`${nodePath(robot, node)}/parameters`)).parameters,
  setParameters: async (robot: string, node: string, parameters: Record<string, Json>, keep: boolean) =>
    (await sendExact<{ results: SetResult[] }>("PATCH", `${nodePath(robot, node)}/parameters`, { parameters, keep })).results,
  lifecycle: (robot: string, node: string) => request<Lifecycle>(`${nodePath(robot, node)}/lifecycle`),
  transit: (robot: string, node: string, transition: string, keep: boolean) =>
    send<Lifecycle & { success: boolean }>("POST", `${nodePath(robot, node)}/lifecycle`, { transition, keep }),
};
