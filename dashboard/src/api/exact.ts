/** Requests whose numbers come and go as they were written: 10.0 is another ROS parameter than 10; and the key under which one counts once. */

import { readJson, writeJson, type Json } from "../values/json";
import { requestBytes, type Method } from "./client";

const decoder = new TextDecoder();

export async function askExact<T>(path: string, init?: RequestInit): Promise<T> {
  return readJson(decoder.decode(await requestBytes(path, init))) as T;
}

export const sendExact = <T>(method: Method, path: string, body: Json, headers: Record<string, string> = {}): Promise<T> =>
  askExact(path, { method, headers: { "content-type": "application/json", ...headers }, body: writeJson(body) });

/** A key that nobody else has: the same order under it is the same command, however often it is sent. */
export function newKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16)); // randomUUID is not there over plain http
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
