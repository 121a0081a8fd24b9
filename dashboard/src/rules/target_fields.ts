/** The table of what rules do: the fields of each kind of target, as gateway/automation/rules/target_kinds.py has them. */

import type { Json, JsonObject } from "../values/json";

export interface TargetField {
  key: string;
  label: string;
  hint?: string;
  placeholder?: string;
  /** How its text becomes a value; text unless said otherwise. */
  as?: "number" | "list";
  choices?: readonly string[];
}

const ROBOT: TargetField = { key: "robot", label: "Robot", placeholder: "the event's own" };

export const TARGETS: Record<string, { word: string; fields: TargetField[]; start: JsonObject }> = {
  function: { word: "call a function", fields: [{ key: "function", label: "Function" }, { key: "qualifier", label: "Alias or version", placeholder: "$LATEST" }], start: { function: "" } },
  webhook: { word: "ask a webhook", fields: [{ key: "url", label: "URL", placeholder: "https://" }], start: { url: "https://" } },
  command: { word: "send a command", fields: [{ key: "command", label: "Command", placeholder: "dock" }, ROBOT], start: { command: "" } },
  publish: {
    word: "publish on a topic",
    fields: [{ key: "topic", label: "Topic", placeholder: "/dock" }, { key: "type", label: "Type", placeholder: "std_msgs/msg/String" }, ROBOT, { key: "lease_id", label: "Lease", hint: "Topics that move a robot need one." }],
    start: { topic: "" },
  },
  capture: { word: "keep a recording", fields: [{ key: "last_s", label: "Last seconds", as: "number" }, { key: "topics", label: "Topics", as: "list", placeholder: "every topic" }, ROBOT], start: { last_s: 60 } },
  alert: { word: "raise an alert", fields: [{ key: "severity", label: "Severity", choices: ["info", "warning", "error"] }, { key: "reason", label: "Reason" }, ROBOT], start: { severity: "warning", reason: "" } },
  aws: { word: "hand it to AWS", fields: [{ key: "service", label: "Service", choices: ["lambda", "sns", "sqs", "events", "s3"] }], start: { service: "sqs", queue_url: "https://" } },
};

const REGION: TargetField = { key: "region", label: "Region", placeholder: "the gateway's" };
export const SERVICES: Record<string, TargetField[]> = {
  lambda: [{ key: "function", label: "Function or ARN" }, { key: "qualifier", label: "Qualifier" }, REGION],
  sns: [{ key: "topic_arn", label: "Topic's ARN" }, { key: "subject", label: "Subject" }, REGION],
  sqs: [{ key: "queue_url", label: "Queue's URL" }, REGION],
  events: [{ key: "bus", label: "Event bus", placeholder: "default" }, { key: "source", label: "Source" }, { key: "detail_type", label: "Detail type" }, REGION],
  s3: [{ key: "bucket", label: "Bucket" }, { key: "prefix", label: "Prefix" }, REGION],
};

export const fieldsOf = (target: JsonObject): TargetField[] => [...(TARGETS[String(target.kind)]?.fields ?? []), ...(target.kind === "aws" ? (SERVICES[String(target.service)] ?? []) : [])];

/** A new target of a kind, with an id that no other has. */
export function newTarget(kind: string, others: readonly Json[]): JsonObject {
  const taken = new Set(others.map((one) => (one as JsonObject).id));
  let id = kind;
  for (let i = 2; taken.has(id); i += 1) id = `${kind}_${i}`;
  return { id, kind, ...TARGETS[kind]!.start };
}

export function fieldText(value: Json | undefined): string {
  if (value == null) return "";
  return Array.isArray(value) ? value.map(String).join(" ") : String(value);
}

/** What a field's text means; undefined: it is left out. A number that is none stays text, and the gateway says so. */
export function fieldValue(text: string, as: TargetField["as"]): Json | undefined {
  if (text === "") return undefined;
  if (as === "list") return text.split(/[\s,]+/).filter(Boolean);
  if (as === "number") return text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : text;
  return text;
}
