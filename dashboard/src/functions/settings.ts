/** The form of a function's settings: as text, and what of it is a change. */

import type { FunctionDetail, Settings } from "../api/functions";

export interface SettingsForm {
  description: string;
  handler: string;
  timeout: string;
  memory: string;
  disk: string;
  reserved: string;
  retries: string;
  age: string;
  onSuccess: string;
  onFailure: string;
  environment: string;
}

export const formOf = (one: FunctionDetail): SettingsForm => ({
  description: one.description,
  handler: one.handler,
  timeout: String(one.timeout_s),
  memory: String(one.memory_mb),
  disk: String(one.disk_mb),
  reserved: one.concurrency.reserved === null ? "" : String(one.concurrency.reserved),
  retries: String(one.event_invoke.most_retries),
  age: String(one.event_invoke.most_age_s),
  onSuccess: one.event_invoke.on_success,
  onFailure: one.event_invoke.on_failure,
  environment: environmentText(one.environment),
});

const environmentText = (environment: Record<string, string>) => Object.entries(environment).map(([name, value]) => `${name}=${value}`).join("\n");

const NUMBERS = [["timeout", "timeout_s"], ["memory", "memory_mb"], ["disk", "disk_mb"]] as const;
const EVENT_NUMBERS = [["retries", "most_retries"], ["age", "most_age_s"]] as const;
const DESTINATIONS = [["onSuccess", "on_success"], ["onFailure", "on_failure"]] as const;
export const isNumber = (text: string) => /^\d{1,9}$/.test(text.trim());

/** Lines of NAME=value; the first that is none, else "". */
export const wrongLine = (text: string) => text.split("\n").find((line) => line.trim() !== "" && !/^\s*[A-Za-z]\w*=/.test(line)) ?? "";

export function readEnvironment(text: string): Record<string, string> {
  const lines = text.split("\n").filter((line) => line.trim() !== "");
  return Object.fromEntries(lines.map((line) => [line.slice(0, line.indexOf("=")).trim(), line.slice(line.indexOf("=") + 1)]));
}

/** What the form says otherwise than the function is. */
export function changeOf(one: FunctionDetail, form: SettingsForm): Settings {
  const before = formOf(one);
  const change: Settings = {};
  if (form.description !== before.description) change.description = form.description;
  if (form.handler !== before.handler) change.handler = form.handler.trim();
  const differs = (field: keyof SettingsForm) => form[field].trim() !== before[field];
  for (const [field, name] of NUMBERS) if (differs(field) && isNumber(form[field])) change[name] = Number(form[field]);
  const events: NonNullable<Settings["event_invoke"]> = {};
  for (const [field, name] of EVENT_NUMBERS) if (differs(field) && isNumber(form[field])) events[name] = Number(form[field]);
  for (const [field, name] of DESTINATIONS) if (differs(field)) events[name] = form[field].trim();
  if (Object.keys(events).length > 0) change.event_invoke = events;
  if (form.reserved.trim() !== before.reserved) change.reserved = form.reserved.trim() === "" ? -1 : Number(form.reserved);
  if (form.environment !== before.environment) change.environment = readEnvironment(form.environment);
  return change;
}
