/** Typed calls for commands that are kept: send one, look at the history, take one back. */

import { writeJson, type Json, type JsonObject } from "../values/json";
import { robotPath, send } from "./client";
import { askExact } from "./exact";

export type CommandKind = "publish" | "call_service" | "node_verb" | "read_log" | "save_recording" | "set_uplink";
export type CommandEnd = "done" | "failed" | "expired" | "cancelled";
export type CommandState = "issued" | "delivered" | "running" | CommandEnd;

export interface Command {
  id: string;
  robot: string;
  /** A newer gateway may have kinds that this page does not know. */
  kind: CommandKind | (string & {});
  /** Its numbers are as they were written, like those of the result: 2^60 is one of a message's. */
  request: Json;
  state: CommandState;
  durable: boolean;
  issued_by: string;
  idempotency_key: string | null;
  timeout_s: number;
  issued: string;
  expires: string | null;
  delivered: string | null;
  running: string | null;
  ended: string | null;
  code: string;
  message: string;
  result: Json;
}

export interface CommandPage {
  commands: Command[];
  next: string | null;
}

export interface CommandOrder {
  kind: CommandKind;
  request: JsonObject;
  durable: boolean;
  expires_s?: number;
  timeout_s?: number;
}

/** As the gateway tells it; its own numbers are ordinary ones. */
const plain = (command: Command): Command => ({ ...command, timeout_s: Number(command.timeout_s) });

export const commandsApi = {
  list: async (robot: string, state: CommandState | "", before: string | null, limit = 50): Promise<CommandPage> => {
    const query = new URLSearchParams({ robot, limit: String(limit) });
    if (state) query.set("state", state);
    if (before) query.set("before", before);
    const { commands, next } = await askExact<CommandPage>(`/commands?${query}`);
    return { commands: commands.map(plain), next };
  },
  send: (robot: string, { kind, request, ...rest }: CommandOrder, key: string) =>
    askExact<Command>(`${robotPath(robot)}/commands`, {
      method: "POST",
      headers: { "content-type": "application/json", "idempotency-key": key },
      body: writeJson({ kind, request, ...(rest as JsonObject) }),
    }),
  cancel: (id: string) => send<Command>("DELETE", `/commands/${encodeURIComponent(id)}`),
};
