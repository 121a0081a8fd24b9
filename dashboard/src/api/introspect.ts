/** Typed calls about what a robot's nodes offer: types, the graph, publishing once, calling a service. */

import type { Json, JsonObject } from "../values/json";
import { call } from "./call";
import { BASE_PATH, request, robotPath } from "./client";
import { askExact, sendExact } from "./exact";
import type { Goal, RobotGraph, TypeConstant, TypeField, TypeShape as Told } from "./schema.js";

/** One field: of a list `capacity` is the n of `T[n]` and `T[<=n]`, else 0; a default of null is zero, empty text or an empty list. */
export type FieldShape = Omit<TypeField, "default"> & { default: Json };
export type ConstantShape = Omit<TypeConstant, "value"> & { value: Json };

/** What a type is made of. Its numbers are as they were written: a default may be 10.0 or 2^60. */
export type TypeShape = Omit<Told, "definitions"> & { definitions: Record<string, { fields: FieldShape[]; constants: ConstantShape[] }> };

/** Of a graph, `revision` 0: the robot's agent has told nothing; it may be too old to. */
export type { Endpoint, Goal, GraphService, GraphTopic, RobotGraph } from "./schema.js";

/** Of each robot and type, once a page: types do not change under their name. */
const shapes = new Map<string, Promise<TypeShape>>();
const SHAPES_KEPT = 200;

function shape(robot: string, type: string): Promise<TypeShape> {
  const key = `${robot} ${type}`;
  const known = shapes.get(key);
  if (known) return known;
  if (shapes.size >= SHAPES_KEPT) shapes.clear();
  const asked = askExact<TypeShape>(`${robotPath(robot)}/types/${type.split("/").map(encodeURIComponent).join("/")}`);
  shapes.set(key, asked);
  asked.catch(() => shapes.delete(key));
  return asked;
}

export const introspectApi = {
  shape,
  /** Of the robots that told theirs. */
  graphs: async () => (await request<{ robots: RobotGraph[] }>("/graph?limit=1000")).robots,
  graph: (robot: string) => request<RobotGraph>(`${robotPath(robot)}/graph`),
  publish: (robot: string, topic: string, type: string, message: JsonObject) =>
    sendExact<{ ok: boolean }>("POST", `${robotPath(robot)}/publish`, { topic, type, message }),
  call: async (robot: string, service: string, type: string, body: JsonObject, timeoutS: number) =>
    (await sendExact<{ response: JsonObject }>("POST", `${robotPath(robot)}/services/call`, { service, type, request: body, timeout_s: timeoutS })).response,
  /** The same goal under the same key is begun once, however often it is sent. */
  beginGoal: (robot: string, action: string, type: string, goal: JsonObject, timeoutS: number, key: string) =>
    sendExact<Goal>("POST", `${robotPath(robot)}/actions/${encodeURIComponent(action)}`, { type, goal, timeout_s: timeoutS }, { "idempotency-key": key }),
  /** For an EventSource: `status`, `feedback`, at last `result`. */
  goalUrl: (robot: string, goal: string) => `${BASE_PATH}${robotPath(robot)}/goals/${goal}/feedback`,
  cancelGoal: async (robot: string, goal: string) => (await call("POST /robots/{robot_id}/goals/{goal}/cancel", { path: { robot_id: robot, goal }, body: {} })).canceling,
};
