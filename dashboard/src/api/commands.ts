/** Typed calls for commands that are kept: send one, look at the history, take one back. */

import { request, robotPath, send } from "./client";

export type CommandKind = "publish" | "call_service" | "node_verb" | "read_log" | "save_recording" | "set_uplink";
export type CommandEnd = "done" | "failed" | "expired" | "cancelled";
export type CommandState = "issued" | "delivered" | "running" | CommandEnd;

export interface Command {
  id: string;
  robot: string;
  /** A newer gateway may have kinds that this page does not know. */
  kind: CommandKind | (string & {});
  request: unknown;
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
  result: unknown;
}

export interface CommandPage {
  commands: Command[];
  next: string | null;
}

export interface CommandOrder {
  kind: CommandKind;
  request: Record<string, unknown>;
  durable: boolean;
  expires_s?: number;
  timeout_s?: number;
}

/** A key that nobody else has: the same order under it is the same command, however often it is sent. */
export function newKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16)); // randomUUID is not there over plain http
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

export const commandsApi = {
  list: (robot: string, state: CommandState | "", before: string | null, limit = 50) => {
    const query = new URLSearchParams({ robot, limit: String(limit) });
    if (state) query.set("state", state);
    if (before) query.set("before", before);
    return request<CommandPage>(`/commands?${query}`);
  },
  send: (robot: string, order: CommandOrder, key: string) =>
    request<Command>(`${robotPath(robot)}/commands`, {
      method: "POST",
      headers: { "content-type": "application/json", "idempotency-key": key },
      body: JSON.stringify(order),
    }),
  cancel: (id: string) => send<Command>("DELETE", `/commands/${encodeURIComponent(id)}`),
};
