/** Commands in words: what one asks for, and what each kind of them is called. */

import type { Command, CommandKind } from "../api/commands";
import { bytesPerSecond, duration } from "../ui/format";
import { isNumeric, isObject, readJson, type Json, type JsonObject } from "../values/json";

export interface KindWords {
  kind: CommandKind;
  word: string;
  hint: string;
  /** What one has to be allowed. */
  needs: string;
}

/** What the form offers; logs are read on the Nodes tab. */
export const KINDS: readonly KindWords[] = [
  { kind: "call_service", word: "Call a service", hint: "and keep what it answers", needs: "robots.call" },
  { kind: "publish", word: "Publish", hint: "one message on a topic", needs: "robots.publish" },
  { kind: "node_verb", word: "Node", hint: "start, stop, restart or signal one", needs: "nodes.control" },
  { kind: "save_recording", word: "Recording", hint: "save the last minutes of the black box", needs: "recordings.save" },
  { kind: "set_uplink", word: "Uplink", hint: "limit what the robot sends", needs: "robots.configure" },
];

const VERBS: Record<string, string> = { start: "Start", stop: "Stop", restart: "Restart", retry: "Retry", signal: "Signal" };

/** A request may hold anything: a field of it as text, "" where it has none. */
export function fieldOf(request: Json, name: string): string {
  const value = isObject(request) ? request[name] : undefined;
  return typeof value === "string" || typeof value === "boolean" || isNumeric(value) ? String(value) : "";
}

/** "Call /sim_1/base/resume": one line. */
export function titleOf({ kind, request }: Pick<Command, "kind" | "request">): string {
  const field = (name: string) => fieldOf(request, name);
  switch (kind) {
    case "publish":
      return `Publish on ${field("topic")}`;
    case "call_service":
      return `Call ${field("service")}`;
    case "node_verb": {
      const verb = field("verb");
      return verb === "signal" ? `Send signal ${field("signal")} to ${field("node")}` : `${VERBS[verb] ?? verb} ${field("node")}`;
    }
    case "read_log":
      return `Read the log of ${field("node")}`;
    case "save_recording":
      return `Save the last ${duration(Number(field("last_s")))}`;
    case "set_uplink": {
      const limit = Number(field("bytes_per_s"));
      return limit > 0 ? `Limit the uplink to ${bytesPerSecond(limit)}` : "Lift the uplink's limit";
    }
    default:
      return kind.replaceAll("_", " ");
  }
}

/** What a code means, for a command whose gateway says no more than that. */
const CODE_WORDS: Record<string, string> = {
  lease_required: "it moves the robot, which the drive pad alone may",
  stale: "it came too late to be safe",
  timeout: "the robot did not answer in time; whether it acted is not known",
  robot_offline: "the robot is not linked",
  interrupted: "the robot's agent was killed while it ran; it is not run again",
  cancelled: "somebody took it back",
};

/** Why a command came to nothing; "" for one that went well. */
export const whyOf = ({ code, message }: Pick<Command, "code" | "message">) =>
  message && message !== code ? message : Object.hasOwn(CODE_WORDS, code) ? CODE_WORDS[code]! : code;

/** A JSON document that somebody typed; throws an Error whose message says where it stops being one. */
export function parseObject(text: string): JsonObject {
  let value: Json;
  try {
    value = readJson(text.trim() ? text : "{}");
  } catch (error) {
    throw new Error(`This is no JSON: ${placed(error, text)}`);
  }
  if (!isObject(value)) throw new Error("A message is a JSON object: {…}");
  return value;
}

/** Browsers say "at position 17"; people count lines. */
function placed(error: unknown, text: string): string {
  const said = error instanceof Error ? error.message.replace(/^JSON\.parse: /, "") : String(error);
  const found = /at position (\d+)/.exec(said);
  if (!found || said.includes("line")) return said;
  return `${said}, line ${text.slice(0, Number(found[1])).split("\n").length}`;
}

export const EXPIRIES: readonly [string, number][] = [
  ["1 h", 3600],
  ["12 h", 43_200],
  ["1 day", 86_400],
  ["7 days", 604_800],
  ["30 days", 2_592_000],
];

/** Signals that people send to nodes; their numbers are the same on every Linux. */
export const SIGNALS: readonly [string, number][] = [
  ["HUP", 1],
  ["INT", 2],
  ["USR1", 10],
  ["USR2", 12],
  ["TERM", 15],
  ["KILL", 9],
];
