/** A topic's quality of service, as rmw_zenoh writes it, in words. What is left out there has its default. */

const RELIABILITY: Record<string, string> = { "": "reliable", "1": "reliable", "2": "best effort", "4": "best available" };
const DURABILITY: Record<string, string> = { "": "volatile", "1": "transient local", "2": "volatile", "4": "best available" };
const DEFAULT_DEPTH = "42";

export interface Qos {
  /** "best effort · keep last 5": what matters most, and nothing that everybody has. */
  short: string;
  /** All of it, name by name. */
  rows: [string, string][];
}

/** Null for what is no such text. */
export function qosOf(text: string): Qos | null {
  const parts = text.split(":");
  const [reliability, durability, history, deadline, lifespan, liveliness] = parts;
  if (parts.length < 6 || liveliness === undefined) return null;
  const [keep = "", depth = ""] = history!.split(",");
  const [alive = "", ...lease] = liveliness.split(",");
  const reliable = RELIABILITY[reliability!] ?? "unknown";
  const durable = DURABILITY[durability!] ?? "unknown";
  const kept = keep === "2" ? "keep all" : `keep last ${depth || DEFAULT_DEPTH}`;
  const rows: [string, string][] = [["reliability", reliable], ["durability", durable], ["history", kept]];
  const spans: [string, string][] = [["deadline", deadline!], ["lifespan", lifespan!], ["lease", lease.join(",")]];
  for (const [name, span] of spans) if (span.replace(",", "")) rows.push([name, seconds(span)]);
  if (alive === "3") rows.push(["liveliness", "manual by topic"]);
  return { short: [reliable, durable !== "volatile" && durable, kept].filter(Boolean).join(" · "), rows };
}

function seconds(text: string): string {
  const [whole = "0", nano = "0"] = text.split(",");
  return `${Number((Number(whole || 0) + Number(nano || 0) / 1e9).toPrecision(4))}\u202fs`;
}
