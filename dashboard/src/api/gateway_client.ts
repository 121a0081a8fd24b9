/** A client of a Meta-ROS gateway for programs: typed calls of every REST operation, with an API key. No dependency. */

import { prepared, type AnswerOf, type Arguments, type Operation } from "./operation.js";
import type { Problem } from "./schema.js";

export interface ClientOptions {
  /** Where the gateway is: `https://fleet.example`. */
  url: string;
  /** What goes behind "Authorization: Bearer"; without one you are who the gateway lets in without. */
  key?: string;
  /** After so long a request is given up; 30 s by default. */
  timeoutMs?: number;
  /** How often a GET is tried again that met a busy gateway; 2 by default. */
  retries?: number;
  /** Another `fetch`, for tests or a proxy. */
  fetch?: typeof fetch;
}

/** A request that was refused: `code` is stable, see the gateway's errors.md. Status 0: nothing answered. */
export class GatewayError extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
    /** Seconds to wait before the next attempt, where the gateway says so. */
    readonly retryAfterS: number | null = null,
  ) {
    super(message);
    this.name = "GatewayError";
  }
}

const BUSY = new Set([0, 429, 503]);
const MOST_WAIT_S = 10;

export class GatewayClient {
  readonly #options: Required<Omit<ClientOptions, "key">> & { key: string };

  constructor({ url, key = "", timeoutMs = 30_000, retries = 2, fetch: ask = fetch }: ClientOptions) {
    this.#options = { url: url.replace(/\/+$/, ""), key, timeoutMs, retries, fetch: ask };
  }

  /** `await gateway.call("GET /robots/{robot_id}/topics", { path: { robot_id: "sim_1" } })`; GatewayError when refused. */
  async call<K extends Operation>(operation: K, ...[given]: Arguments<K>): Promise<AnswerOf<K>> {
    const { method, path, body } = prepared(operation, given);
    for (let attempt = 0; ; attempt += 1) {
      try {
        return (await this.#once(method, path, body)) as AnswerOf<K>;
      } catch (error) {
        const again = method === "GET" && error instanceof GatewayError && BUSY.has(error.status) && attempt < this.#options.retries;
        if (!again) throw error;
        const waitS = Math.min(error.retryAfterS ?? 0.2 * 2 ** attempt, MOST_WAIT_S) * (1 + Math.random() / 4); // not all at once
        await new Promise((resolve) => setTimeout(resolve, waitS * 1000));
      }
    }
  }

  async #once(method: string, path: string, body: string | undefined): Promise<unknown> {
    const { url, key, timeoutMs, fetch: ask } = this.#options;
    const headers: Record<string, string> = key ? { authorization: `Bearer ${key}` } : {};
    if (body !== undefined) headers["content-type"] = "application/json";
    let response: Response;
    try {
      response = await ask(`${url}/api/v1${path}`, { method, body, headers, signal: AbortSignal.timeout(timeoutMs) });
    } catch (error) {
      throw new GatewayError(0, "unreachable", error instanceof Error ? error.message : String(error));
    }
    const said: unknown = await response.json().catch(() => null);
    if (response.ok) return said;
    const problem = (said ?? {}) as Partial<Problem>;
    const wait = Number(problem.retry_after_s ?? response.headers.get("retry-after")) || null;
    throw new GatewayError(response.status, problem.code ?? "http", problem.detail || problem.title || `HTTP ${response.status}`, wait);
  }
}
