/** Desired beside what is so: one row for each value of the document, with what the robot itself has there. */

import type { Twin } from "../api/twin";
import { isNumeric, isObject, same, type Json, type JsonObject } from "../values/json";
import { at, leaves, undone, type Path } from "./document";

export type Mark = "same" | "add" | "remove" | "change" | "unknown";

export interface Compared {
  section: string;
  /** Of the row in its section: a topic, a node; "" where the section has no rows. */
  name: string;
  key: string;
  desired: Json | undefined;
  robot: Json | undefined;
  mark: Mark;
  why: string;
  /** The value comes from the robot's own document, not from a template. */
  own: boolean;
}

export const SECTIONS: Record<string, string> = {
  topics: "Topics",
  nodes: "Nodes",
  parameters: "Parameters",
  lifecycle: "Lifecycle",
  budget: "Uplink budget",
  agent: "Agent",
};
const ORDER = Object.keys(SECTIONS);

/** Whether values that were read by programs of two kinds are alike: 5 and 5.0 are. */
const alike = (one: Json | undefined, other: Json | undefined) =>
  same(one, other) || (isNumeric(one) && isNumeric(other) && Number(one) === Number(other));

export function compare(twin: Twin, namespace: string): Compared[] {
  const values = twin.reported?.values ?? {};
  const current = twin.in_step || twin.reported?.applied === twin.revision;
  const known = current || twin.behind.length > 0;
  const living = current ? twin.desired : undone(twin.desired, twin.behind);
  const paths = new Map<string, Path>();
  for (const { path } of [...leaves(twin.desired), ...leaves(living)]) paths.set(JSON.stringify(path), path);
  const rows = [...paths.values()].filter((path) => !isObject(at(twin.desired, path)) || at(living, path) === undefined || isObject(at(living, path)));
  const found = rows.map((path): Compared => {
    const wanted = at(twin.desired, path);
    const seen = observed(path, values, namespace, wanted);
    const robot = seen ? seen.value : known ? at(living, path) : undefined;
    const [section, ...rest] = path as [string, ...string[]];
    const single = section === "budget" || section === "agent";
    return {
      section,
      name: single ? "" : (rest[0] ?? ""),
      key: (single ? rest : rest.slice(1)).join("."),
      desired: wanted,
      robot,
      mark: seen?.fits ? "same" : markOf(wanted, robot, known || seen !== null),
      why: seen?.why ?? "",
      own: at(twin.own, path) !== undefined,
    };
  });
  return found.sort((a, b) => ORDER.indexOf(a.section) - ORDER.indexOf(b.section) || a.name.localeCompare(b.name));
}

function markOf(wanted: Json | undefined, robot: Json | undefined, known: boolean): Mark {
  if (!known) return "unknown";
  if (alike(wanted, robot)) return "same";
  return robot === undefined ? "add" : wanted === undefined ? "remove" : "change";
}

interface Seen {
  value: Json | undefined;
  why?: string;
  /** It is as it should be, though the words differ. */
  fits?: boolean;
}

/** What the robot reports about just this value; null where it says nothing. */
function observed(path: Path, values: JsonObject, namespace: string, wanted: Json | undefined): Seen | null {
  const [section, name = "", ...rest] = path;
  const key = rest.join(".");
  const text = (value: Json | undefined) => (typeof value === "string" ? value : "");
  if (section === "agent") return seen(at(values, ["agent", "version"]), text(at(values, ["agent", "update", "message"])));
  if (section === "budget") return seen(at(values, ["budget", "bytes_per_s"]));
  if (section === "lifecycle") {
    const row = at(values, ["lifecycle", fullName(name, namespace)]);
    return seen(at(row, ["state"]), text(at(row, ["message"])));
  }
  if (section === "parameters") {
    const row = at(values, ["parameters", fullName(name, namespace)]);
    const refused = text(at(row, ["refused", key]));
    if (refused) return { value: at(row, ["values", key]), why: refused };
    return seen(at(row, ["values", key]), at(row, ["state"]) === "waiting" ? text(at(row, ["message"])) || "waits for the node" : "");
  }
  const row = section === "nodes" ? at(values, ["nodes", name]) : undefined;
  if (!isObject(row)) return null;
  if (key === "version") return seen(row.version, text(at(row, ["update", "message"])));
  if (key === "nice") return seen(row.nice);
  if (key !== "run") return null;
  const state = text(row.state);
  return state ? { value: state, fits: wanted === false ? state === "stopped" : state === "running", why: text(row.why) || text(row.last_exit) } : null;
}

const seen = (value: Json | undefined, why = ""): Seen | null => (value === undefined ? null : { value, why });

/** A node's name in full, as the robot reports it. */
const fullName = (name: string, namespace: string) =>
  name.startsWith("/") ? name : `${namespace.replace(/\/$/, "")}/${name}`;
