/** What the form of a rollout holds, and the order that it makes. */

import type { Bundle, RolloutOrder } from "../api/rollouts";
import { CARE, wavesOf } from "./words";

/** Texts are as they were typed. */
export interface Plan {
  path: string;
  node: string;
  selector: string;
  waves: string;
  /** Percent. */
  failures: string;
  healthS: string;
  steadyS: string;
  offlineS: string;
}

export const FIRST: Plan = { path: "", node: "", selector: "", waves: CARE[0]![1], failures: "10", healthS: "600", steadyS: "10", offlineS: "300" };

export function orderOf(plan: Plan, bundle: Bundle): RolloutOrder {
  const isNode = bundle.kind === "node";
  return {
    version: bundle.version,
    selector: plan.selector.trim(),
    node: isNode ? plan.node.trim() || bundle.name : "",
    bundle: isNode ? bundle.name : "",
    waves: wavesOf(plan.waves),
    max_failure_rate: Number(plan.failures) / 100,
    health_s: Number(plan.healthS),
    steady_s: Number(plan.steadyS),
    offline_s: Number(plan.offlineS),
  };
}
