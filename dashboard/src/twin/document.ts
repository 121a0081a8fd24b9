/** Parts of a twin's document: read and set by a path, and the merge patch (RFC 7396) between two. */

import { blank, copy, isObject, same, type Json, type JsonObject } from "../values/json";

export type Path = readonly string[];

/** "/nodes/lidar/nice" to its parts (RFC 6901). */
export const pathOf = (pointer: string): string[] =>
  pointer.split("/").slice(1).map((part) => part.replaceAll("~1", "/").replaceAll("~0", "~"));

const pointerOf = (path: Path) => path.map((part) => `/${part.replaceAll("~", "~0").replaceAll("/", "~1")}`).join("");

export function at(document: Json | undefined, path: Path): Json | undefined {
  let found: Json | undefined = document;
  for (const part of path) found = isObject(found) && Object.hasOwn(found, part) ? found[part] : undefined;
  return found;
}

/** A copy with another value there; `undefined` takes it away, and a section that is left empty with it. */
export function put(document: JsonObject, path: Path, value: Json | undefined): JsonObject {
  const [first, ...rest] = path as [string, ...string[]];
  const next = Object.assign(blank(), document);
  if (rest.length > 0) {
    const below = at(document, [first]);
    const changed = put(isObject(below) ? below : {}, rest, value);
    const emptied = value === undefined && Object.keys(changed).length === 0;
    if (emptied && GO_WHEN_EMPTY.has(first)) delete next[first];
    else next[first] = changed;
  } else if (value === undefined) delete next[first];
  else next[first] = value;
  return next;
}

/** Sections that say nothing when they are empty; `nodes: {}` does: "run none". */
const GO_WHEN_EMPTY: ReadonlySet<string> = new Set(["topics", "parameters", "lifecycle", "budget", "agent"]);

/** What makes `old` into `now` when it is merged over it. */
export function patchBetween(old: JsonObject, now: JsonObject): JsonObject {
  const patch = blank();
  for (const key of Object.keys(old)) if (!Object.hasOwn(now, key)) patch[key] = null;
  for (const [key, value] of Object.entries(now)) {
    const was = at(old, [key]);
    if (was === undefined) patch[key] = copy(value);
    else if (!same(was, value)) patch[key] = isObject(was) && isObject(value) ? patchBetween(was, value) : copy(value);
  }
  return patch;
}

/** `draft`, which was made from `base`, made again from `newest`: only what the person changed is carried over. */
export function rebased(base: JsonObject, draft: JsonObject, newest: JsonObject): JsonObject {
  return edits(base, draft).reduce((found, { path, value }) => put(found, path, value), newest);
}

function edits(old: JsonObject, now: JsonObject, path: Path = []): { path: Path; value: Json | undefined }[] {
  return [...new Set([...Object.keys(old), ...Object.keys(now)])].flatMap((key) => {
    const [was, is] = [at(old, [key]), at(now, [key])];
    if (same(was, is)) return [];
    return isObject(was) && isObject(is) ? edits(was, is, [...path, key]) : [{ path: [...path, key], value: is }];
  });
}

export interface Change {
  path: string;
  verb: "add" | "remove" | "change";
  old?: Json;
  new?: Json;
}

/** A change of a whole row as one of each of its values. */
export function unfolded({ path, verb, old, new: now }: Change): Change[] {
  if (verb === "change") return [{ path, verb, old, new: now }];
  return leaves(verb === "add" ? now : old, pathOf(path)).map((leaf) => ({ path: pointerOf(leaf.path), verb, [verb === "add" ? "new" : "old"]: leaf.value }));
}

/** What templates say, as far as the own document leaves it to them. */
export function given(desired: JsonObject, own: JsonObject): JsonObject {
  const left = leaves(desired).filter(({ path }) => at(own, path) === undefined);
  return left.reduce((found, { path, value }) => put(found, path, value), {} as JsonObject);
}

/** The document before these changes. */
export function undone(document: JsonObject, changes: readonly Change[]): JsonObject {
  return changes.reduce((found, { path, verb, old }) => put(found, pathOf(path), verb === "add" ? undefined : old), document);
}

/** Every value of a document by its path; an empty object is one as well. */
export function leaves(value: Json | undefined, path: Path = []): { path: Path; value: Json }[] {
  if (value === undefined) return [];
  if (!isObject(value) || (path.length > 0 && Object.keys(value).length === 0)) return [{ path, value }];
  return Object.entries(value).flatMap(([key, item]) => leaves(item, [...path, key]));
}
