/** An operation of the gateway by its name, `"GET /robots/{robot_id}"`: what it takes and answers is known to the compiler. */

import type { Operations } from "./schema.js";

export type Operation = keyof Operations;
export type AnswerOf<K extends Operation> = Operations[K]["answer"];
export type BodyOf<K extends Operation> = Operations[K]["body"];
export type QueryOf<K extends Operation> = Operations[K]["query"];

type PathPart<Path> = keyof Path extends never ? { path?: undefined } : { path: Path };
type BodyPart<Body> = undefined extends Body ? { body?: Body } : { body: Body };
type QueryPart<Query> = Record<never, never> extends Query ? { query?: Query } : { query: Query };
/** What has to be given with an operation, and nothing else can be. */
export type Given<K extends Operation> = PathPart<Operations[K]["path"]> & QueryPart<QueryOf<K>> & BodyPart<BodyOf<K>>;
/** Left out where nothing has to be given. */
export type Arguments<K extends Operation> = Record<never, never> extends Given<K> ? [given?: Given<K>] : [given: Given<K>];

export interface Prepared {
  method: string;
  /** Below /api/v1, with its query. */
  path: string;
  body: string | undefined;
}

interface Anything {
  path?: object;
  query?: object;
  body?: unknown;
}

/** The request that an operation is; a value that is left out or null is not in its query, a list is there item by item. */
export function prepared(operation: Operation, { path = {}, query = {}, body }: Anything = {}): Prepared {
  const [method, pattern] = operation.split(" ") as [string, string];
  const filled = pattern.replace(/\{(\w+)\}/g, (_, name: string) => encodeURIComponent(String((path as Record<string, unknown>)[name])));
  const pairs = Object.entries(query).flatMap(([name, value]) => (Array.isArray(value) ? value : [value]).filter((one) => one != null).map((one) => [name, String(one)]));
  const asked = pairs.length > 0 ? `?${new URLSearchParams(pairs)}` : "";
  return { method, path: filled + asked, body: body === undefined ? undefined : JSON.stringify(body) };
}
