/** The form of a check: what was typed, whether it fits, and what of it is another than before. */

import type { AlertCheck, CheckChange, Severity } from "../../api/alerts";

export interface CheckForm {
  enabled: boolean;
  low: string;
  high: string;
  for_s: string;
  clear_s: string;
  severity: Severity;
}

const BOUNDS = ["low", "high"] as const;
const SPANS = ["for_s", "clear_s"] as const;
const MOST_S = 30 * 86_400;
const text = (value: number | null) => (value === null ? "" : String(value));

export const formOf = (one: AlertCheck): CheckForm => ({
  enabled: one.enabled,
  low: text(one.low),
  high: text(one.high),
  for_s: text(one.for_s),
  clear_s: text(one.clear_s),
  severity: one.severity,
});

/** Whether a field holds no number that the gateway takes; an empty bound stays as it is. */
export function isWrong(typed: string, field: (typeof BOUNDS)[number] | (typeof SPANS)[number]): boolean {
  const value = Number(typed);
  const isSpan = (SPANS as readonly string[]).includes(field);
  if (typed.trim() === "") return isSpan;
  return !Number.isFinite(value) || (isSpan && (value < 0 || value > MOST_S));
}

/** What has changed; nothing while a field is wrong. */
export function changeOf(one: AlertCheck, form: CheckForm): CheckChange {
  const numbers = [...BOUNDS, ...SPANS];
  if (numbers.some((field) => isWrong(form[field], field))) return {};
  const change: CheckChange = {};
  for (const field of numbers) {
    if (form[field].trim() !== "" && Number(form[field]) !== one[field]) change[field] = Number(form[field]);
  }
  if (form.enabled !== one.enabled) change.enabled = form.enabled;
  if (form.severity !== one.severity) change.severity = form.severity;
  return change;
}
