/** Operations by their names, `call("GET /robots/{robot_id}/topics", { path: { robot_id } })`: as the person who uses the page. */

import { request } from "./client";
import { prepared, type AnswerOf, type Arguments, type Operation } from "./operation.js";

export async function call<K extends Operation>(operation: K, ...[given]: Arguments<K>): Promise<AnswerOf<K>> {
  const { method, path, body } = prepared(operation, given);
  return request(path, method === "GET" ? undefined : { method, headers: { "content-type": "application/json" }, body });
}
