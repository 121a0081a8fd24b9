/** What the form of a command holds, and the order that it makes. */

import type { Command, CommandKind, CommandOrder } from "../api/commands";
import { isObject, writeJson, type JsonObject } from "../values/json";
import { fieldOf, parseObject } from "./words";

/** Texts are as they were typed; each kind uses those that it needs. */
export interface Form {
  kind: CommandKind;
  topic: string;
  type: string;
  message: string;
  service: string;
  serviceType: string;
  request: string;
  node: string;
  verb: string;
  signal: number;
  lastS: number;
  topics: string;
  /** kB/s; "" is no limit. */
  limit: string;
  durable: boolean;
  expiresS: number;
  timeoutS: string;
}

const TIMEOUT_S = 10;
const LONGEST_S = 120;

export const blankForm = (kind: CommandKind): Form => ({
  kind,
  topic: "",
  type: "",
  message: "{}",
  service: "",
  serviceType: "",
  request: "{}",
  node: "",
  verb: "restart",
  signal: 15,
  lastS: 60,
  topics: "",
  limit: "",
  durable: false,
  expiresS: 3600,
  timeoutS: String(TIMEOUT_S),
});

/** The form that asks for the same again; null for a kind that it does not offer. */
export function formOf({ kind, request, durable, timeout_s: timeoutS }: Command): Form | null {
  const text = (name: string) => fieldOf(request, name);
  const asked = isObject(request) ? request : {};
  const part = (name: string) => writeJson(asked[name] ?? {}, 2);
  const form = { ...blankForm("publish"), durable, timeoutS: String(timeoutS) };
  switch (kind) {
    case "publish":
      if (text("cdr")) return null; // bytes are no form
      return { ...form, topic: text("topic"), type: text("type"), message: part("message") };
    case "call_service":
      return { ...form, kind: "call_service", service: text("service"), serviceType: text("type"), request: part("request") };
    case "node_verb":
      return { ...form, kind: "node_verb", node: text("node"), verb: text("verb"), signal: Number(text("signal")) || form.signal };
    case "save_recording": {
      const topics = asked.topics;
      return { ...form, kind: "save_recording", lastS: Number(text("last_s")) || form.lastS, topics: Array.isArray(topics) ? topics.join(", ") : "" };
    }
    case "set_uplink": {
      const bytes = Number(text("bytes_per_s"));
      return { ...form, kind: "set_uplink", limit: bytes > 0 ? String(bytes / 1000) : "" };
    }
    default:
      return null;
  }
}

/** Throws an Error that says which field cannot be. */
export function orderOf(form: Form): CommandOrder {
  const timeoutS = Number(form.timeoutS);
  if (!(timeoutS > 0 && timeoutS <= LONGEST_S)) throw new Error(`The time-out is more than 0 and at most ${LONGEST_S} s.`);
  const order: CommandOrder = { kind: form.kind, request: requestOf(form), durable: form.durable, timeout_s: timeoutS };
  if (form.kind === "save_recording") return { ...order, durable: false }; // it waits for its robot by itself
  return form.durable ? { ...order, expires_s: form.expiresS } : order;
}

function requestOf(form: Form): JsonObject {
  switch (form.kind) {
    case "publish":
      return { topic: needed(form.topic, "topic"), ...(form.type.trim() && { type: form.type.trim() }), message: parseObject(form.message) };
    case "call_service":
      return { service: needed(form.service, "service"), type: needed(form.serviceType, "type"), request: parseObject(form.request) };
    case "node_verb":
      return { node: needed(form.node, "node"), verb: form.verb, ...(form.verb === "signal" && { signal: form.signal }) };
    case "save_recording": {
      const topics = form.topics.split(/[\s,]+/).filter(Boolean);
      return { last_s: form.lastS, ...(topics.length > 0 && { topics }) };
    }
    default:
      return { bytes_per_s: limitOf(form.limit) };
  }
}

function needed(text: string, name: string): string {
  if (!text.trim()) throw new Error(`Give a ${name}.`);
  return text.trim();
}

function limitOf(text: string): number | null {
  if (!text.trim()) return null;
  const bytes = Math.round(Number(text) * 1000);
  if (!(bytes > 0)) throw new Error("The limit is a number of kB/s; empty is no limit.");
  return bytes;
}
