/** Typed calls for rollouts, and for the versions that they bring. */

import { request, send } from "./client";

export type RolloutState = "running" | "paused" | "halted" | "done" | "aborted";
export type MemberState = "waiting" | "starting" | "updating" | "done" | "failed" | "unreached";

export interface Wave {
  wave: number;
  size: number;
  in_flight: number;
  done: number;
  failed: number;
}

export interface Rollout {
  id: string;
  state: RolloutState;
  reason: string;
  kind: "agent" | "node";
  node: string;
  bundle: string;
  version: string;
  selector: string;
  max_failure_rate: number;
  health_s: number;
  steady_s: number;
  offline_s: number;
  give_up_s: number;
  robots: number;
  /** Which wave it is at, from 1. */
  wave: number;
  waves: Wave[];
  counts: Record<MemberState, number>;
  created: string;
  created_by: string;
  changed: string;
  dry_run: boolean;
}

export interface Member {
  robot: string;
  state: MemberState;
  /** 0 before its turn. */
  wave: number;
  since: string;
  reason: string;
}

export interface RolloutDetail extends Rollout {
  members: Member[];
}

export interface RolloutOrder {
  version: string;
  selector: string;
  /** "" for the agent's own version. */
  node: string;
  bundle: string;
  waves: string[];
  max_failure_rate: number;
  health_s: number;
  steady_s: number;
  offline_s: number;
}

export interface Bundle {
  path: string;
  kind: "node" | "agent";
  name: string;
  version: string;
  min_version: string;
  hw: string[];
  python: string;
  sha256: string;
  size_bytes: number;
  signed: boolean;
  uploaded: string;
  uploaded_by: string;
  withdrawn: string | null;
  reason: string;
}

export interface SignedRole {
  role: string;
  version: number;
  expires: string;
  online: boolean;
}

export interface Updates {
  roles: SignedRole[];
  bundles: Bundle[];
  trouble: string;
}

const path = (id: string) => `/rollouts/${encodeURIComponent(id)}`;

export const rolloutsApi = {
  list: async () => (await request<{ rollouts: Rollout[] }>("/rollouts")).rollouts,
  get: (id: string) => request<RolloutDetail>(path(id)),
  start: (order: RolloutOrder, dryRun: boolean) => send<RolloutDetail>("POST", "/rollouts", { ...order, dry_run: dryRun }),
  pause: (id: string, reason: string) => send<Rollout>("POST", `${path(id)}/pause`, { reason }),
  resume: (id: string, version = "") => send<Rollout>("POST", `${path(id)}/resume`, { version }),
  abort: (id: string, reason: string) => send<Rollout>("POST", `${path(id)}/abort`, { reason }),

  updates: () => request<Updates>("/updates"),
  withdraw: (bundlePath: string, reason: string) => send<Bundle>("POST", "/updates/withdrawals", { path: bundlePath, reason }),
};
