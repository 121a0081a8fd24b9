/** Which alerts the page shows: the address's words, and what they let through. */

import type { Alert, Severity } from "../api/alerts";
import { causeWords, isOver, SEVERITIES } from "./words";

export const STATES = ["open", "acknowledged", "resolved", "all"] as const;
/** "" are those that go on: open and acknowledged ones. */
export type StateChoice = "" | (typeof STATES)[number];
export const STATE_CHOICES: readonly (readonly [StateChoice, string])[] = [
  ["", "going on"],
  ["open", "open"],
  ["acknowledged", "acknowledged"],
  ["resolved", "resolved"],
  ["all", "all"],
];

export const SPANS: Record<string, number> = { "1h": 3_600_000, "6h": 21_600_000, "24h": 86_400_000, "7d": 604_800_000 };
export const USUAL_SPAN = "6h";

export interface Filter {
  state: StateChoice;
  severity: Severity | "";
  robot: string;
  text: string;
}

const among = <T extends string>(known: readonly T[], asked: string | null): T | "" => known.find((one) => one === asked) ?? "";

export const filterOf = (params: URLSearchParams): Filter => ({
  state: among(STATES, params.get("state")),
  severity: among(SEVERITIES, params.get("severity")),
  robot: params.get("robot") ?? "",
  text: params.get("q") ?? "",
});

export const isFiltered = ({ state, severity, robot, text }: Filter) => state !== "" || severity !== "" || robot !== "" || text !== "";

const hasState = (alert: Alert, state: StateChoice) => state === "all" || (state === "" ? !isOver(alert) : alert.state === state);

/** Each word of the text is somewhere in the alert. The timeline shows any state: over or not is what it draws. */
export function lets(alert: Alert, filter: Filter, anyState = false): boolean {
  if (!anyState && !hasState(alert, filter.state)) return false;
  if (filter.severity && alert.severity !== filter.severity) return false;
  if (filter.robot && alert.robot !== filter.robot) return false;
  const said = [alert.robot, alert.title, alert.reason, alert.series, alert.cause, causeWords(alert.cause), alert.assignee, alert.acknowledged_by].join(" ").toLowerCase();
  return filter.text.toLowerCase().split(/\s+/).every((word) => said.includes(word));
}
