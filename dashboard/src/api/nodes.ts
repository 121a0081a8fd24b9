/** Typed calls about a robot's nodes: how they do, what they said, start and stop, parameters and lifecycle. */

import type { Json, Numeric } from "../values/json";
import type { Kind } from "../values/values";
import { call } from "./call";
import { BASE_PATH, robotPath } from "./client";
import { askExact, sendExact } from "./exact";
import type { BodyOf } from "./operation.js";
import type { Lifecycle as ToldLifecycle, Node as ToldNode, NodeResult as ToldResult, Operations, RobotNodes as ToldNodes } from "./schema.js";

export type { Crash, LogLine, LogPage, ReportedNode as NodeReport } from "./schema.js";
export type NodeVerb = Operations["POST /robots/{robot_id}/nodes/{node}/{verb}"]["path"]["verb"];
export type Transition = BodyOf<"POST /robots/{robot_id}/nodes/{node}/lifecycle">["transition"];
/** What an act on a node came to. */
export type NodeResult = Pick<ToldResult, "node" | "outcome" | "told" | "message"> & { verb: NodeVerb };

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

export type Lifecycle = Omit<ToldLifecycle, "transitions"> & { transitions: Transition[] };
export type Node = Omit<ToldNode, "desired"> & { desired: NodeRow | null };
export type RobotNodes = Omit<ToldNodes, "nodes"> & { nodes: Node[] };

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

const nodePath = (robot: string, node: string) => `${robotPath(robot)}/nodes/${encodeURIComponent(node)}`;

const at = (robot: string, node: string) => ({ path: { robot_id: robot, node } });

export const nodesApi = {
  list: (robot: string) => call("GET /robots/{robot_id}/nodes", { path: { robot_id: robot } }) as Promise<RobotNodes>,
  act: (robot: string, node: string, verb: NodeVerb, signal?: number) =>
    call("POST /robots/{robot_id}/nodes/{node}/{verb}", { path: { robot_id: robot, node, verb }, body: signal === undefined ? {} : { signal } }) as Promise<NodeResult>,
  log: (robot: string, node: string, query: Record<string, string>) => call("GET /robots/{robot_id}/nodes/{node}/log", { ...at(robot, node), query }),
  /** For an EventSource: `lines` as they come, `end` with a code and why. */
  tailUrl: (robot: string, node: string, query: Record<string, string>) => `${BASE_PATH}${nodePath(robot, node)}/log/tail?${new URLSearchParams(query)}`,
  crashes: async (robot: string, node: string) => (await call("GET /robots/{robot_id}/nodes/{node}/crashes", at(robot, node))).crashes,
  parameters: async (robot: string, node: string) => (await askExact<{ parameters: Parameter[] }>(`${nodePath(robot, node)}/parameters`)).parameters,
  setParameters: async (robot: string, node: string, parameters: Record<string, Json>, keep: boolean) =>
    (await sendExact<{ results: SetResult[] }>("PATCH", `${nodePath(robot, node)}/parameters`, { parameters, keep })).results,
  lifecycle: (robot: string, node: string) => call("GET /robots/{robot_id}/nodes/{node}/lifecycle", at(robot, node)) as Promise<Lifecycle>,
  transit: (robot: string, node: string, transition: Transition, keep: boolean) =>
    call("POST /robots/{robot_id}/nodes/{node}/lifecycle", { ...at(robot, node), body: { transition, keep } }) as Promise<Lifecycle & { success: boolean }>,
};
