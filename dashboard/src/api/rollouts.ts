/** Typed calls for rollouts, and for the versions that they bring. */

import { call } from "./call";
import type { BodyOf } from "./operation.js";
import type { Rollout as Told, RolloutDetail as ToldDetail, RolloutRobot } from "./schema.js";

export type { Bundle, RolloutRobot as Member, SignedRole, UpdateList as Updates, Wave } from "./schema.js";
export type MemberState = RolloutRobot["state"];
/** Every state is among the counts. */
type Counted<T> = Omit<T, "counts"> & { counts: Record<MemberState, number> };
export type Rollout = Counted<Told>;
export type RolloutDetail = Counted<ToldDetail>;
export type RolloutState = Told["state"];
export type RolloutOrder = Required<Omit<BodyOf<"POST /rollouts">, "dry_run" | "give_up_s">>;

const one = (id: string) => ({ path: { rollout_id: id } });

export const rolloutsApi = {
  list: async () => (await call("GET /rollouts")).rollouts as Rollout[],
  get: (id: string) => call("GET /rollouts/{rollout_id}", one(id)) as Promise<RolloutDetail>,
  start: (order: RolloutOrder, dryRun: boolean) => call("POST /rollouts", { body: { ...order, dry_run: dryRun } }) as Promise<RolloutDetail>,
  pause: (id: string, reason: string) => call("POST /rollouts/{rollout_id}/pause", { ...one(id), body: { reason } }),
  resume: (id: string, version = "") => call("POST /rollouts/{rollout_id}/resume", { ...one(id), body: { version } }),
  abort: (id: string, reason: string) => call("POST /rollouts/{rollout_id}/abort", { ...one(id), body: { reason } }),

  updates: () => call("GET /updates"),
  withdraw: (path: string, reason: string) => call("POST /updates/withdrawals", { body: { path, reason } }),
};
