/** Typed calls of the gateway's REST interface. Every failure is an ApiError with the server's own words. */

import type { AnswerOf } from "./operation.js";
import type { Problem } from "./schema.js";
import { refresh, session } from "./session";

const BASE = "/api/v1";

export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
    /** Seconds to wait before the next attempt, where the gateway says so. */
    readonly retryAfterS: number | null = null,
  ) {
    super(message);
  }
}

/** What these are refused with is about what was typed, not about who uses the page. */
const SIGN_IN = ["/auth/login", "/auth/link"];

export type Method = "POST" | "PUT" | "PATCH" | "DELETE";

/** The answer to a request that went well; an abort stays an AbortError. */
async function ask(path: string, init?: RequestInit): Promise<Response> {
  try {
    return await once(path, init);
  } catch (error) {
    if (!(error instanceof ApiError) || SIGN_IN.includes(path)) throw error;
    if (error.status === 401) await refresh(); // nobody known is shown the sign-in page
    if (error.code !== "csrf") throw error;
    await refresh(); // another tab has signed in anew: the token is another one
    return once(path, init);
  }
}

async function once(path: string, init?: RequestInit): Promise<Response> {
  const token = session.peek()?.csrf;
  const headers = token && init?.method ? { ...init.headers, "x-csrf-token": token } : init?.headers;
  let response: Response;
  try {
    response = await fetch(BASE + path, { ...init, headers });
  } catch (error) {
    if (init?.signal?.aborted) throw error;
    throw new ApiError(0, "unreachable", "the gateway does not answer");
  }
  if (response.ok) return response;
  const problem = ((await response.json().catch(() => null)) ?? {}) as Partial<Problem>;
  const said = problem.detail || problem.title || `HTTP ${response.status}`;
  const waitS = response.status === 429 ? problem.retry_after_s || Number(response.headers.get("retry-after")) || null : null;
  const again = waitS === null ? "" : `; try again in ${waitWords(waitS)}`;
  throw new ApiError(response.status, problem.code ?? "http", said + again, waitS);
}

/** "12 s", "3 min": never shorter than it is. */
export const waitWords = (seconds: number) => (seconds <= 90 ? `${Math.ceil(seconds)} s` : `${Math.ceil(seconds / 60)} min`);

export async function request<T>(path: string, init?: RequestInit): Promise<T> {
  return (await (await ask(path, init)).json().catch(() => null)) as T;
}

export async function requestBytes(path: string, init?: RequestInit): Promise<ArrayBuffer> {
  return (await ask(path, init)).arrayBuffer();
}

/** Change something; a session's token goes along. */
export function send<T>(method: Method, path: string, body?: unknown): Promise<T> {
  return request(path, {
    method,
    headers: { "content-type": "application/json" },
    body: body === undefined ? undefined : JSON.stringify(body),
  });
}

/** What a failure says to a person. */
export const saidOf = (error: unknown) => (error instanceof Error ? error.message : String(error));

export const BASE_PATH = BASE;
export const robotPath = (id: string) => `/robots/${encodeURIComponent(id)}`;

/** What the pages that are fetched first ask for; the rest goes by its name, see call.ts. */
export const api = {
  topics: async (id: string) => (await request<AnswerOf<"GET /robots/{robot_id}/topics">>(`${robotPath(id)}/topics`)).topics,
  metrics: async (id: string) => (await request<AnswerOf<"GET /robots/{robot_id}/metrics">>(`${robotPath(id)}/metrics`)).series,
  /** Whether the robot ever had an alert that is remembered. */
  hadAlerts: async (id: string) => (await request<AnswerOf<"GET /alerts">>(`/alerts?${new URLSearchParams({ robot: id, limit: "1" })}`)).alerts.length > 0,
  range: (id: string, names: string[], start: string, points: number) => {
    const query = new URLSearchParams([...names.map((name) => ["name", name]), ["start", start], ["end", "now"], ["points", String(points)]]);
    return request<AnswerOf<"GET /robots/{robot_id}/metrics/range">>(`${robotPath(id)}/metrics/range?${query}`);
  },
};

/** The WebSocket address of a path on the gateway that served this page. */
export function socketUrl(path: string, page: { protocol: string; host: string } = location): string {
  return `${page.protocol === "https:" ? "wss" : "ws"}://${page.host}${BASE}${path}`;
}

/** The gateway closes a socket so when whoever opened it may not be there any more, or may something else by now. */
const RIGHTS_CHANGED = 4401;

/** A socket of this page. When it is refused or shown out the page asks who it is. */
export function openSocket(path: string): WebSocket {
  const socket = new WebSocket(socketUrl(path));
  let opened = false;
  socket.addEventListener("open", () => (opened = true));
  socket.addEventListener("close", ({ code }) => {
    if (code === RIGHTS_CHANGED || !opened) void refresh();
  });
  return socket;
}

export const teleopPath = (id: string) => `${robotPath(id)}/teleop`;
