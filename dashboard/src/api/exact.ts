/** Requests whose numbers come and go as they were written: 10.0 is another ROS parameter than 10. */

import { readJson, writeJson, type Json } from "../fleet_ops/json";
import { requestBytes, type Method } from "./client";

const decoder = new TextDecoder();

export async function askExact<T>(path: string, init?: RequestInit): Promise<T> {
  return readJson(decoder.decode(await requestBytes(path, init))) as T;
}

export const sendExact = <T>(method: Method, path: string, body: Json, headers: Record<string, string> = {}): Promise<T> =>
  askExact(path, { method, headers: { "content-type": "application/json", ...headers }, body: writeJson(body) });
