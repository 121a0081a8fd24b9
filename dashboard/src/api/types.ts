/** The gateway's shapes as the page uses them: those of REST as its OpenAPI has them, and those of the stream. */

import type { Robot } from "./schema.js";

export type {
  ClassDepth, DeclaredGap as Gap, Problem, Robot, SeriesPiece as SeriesRange, SeriesState as SeriesInfo, Topic, Uplink,
} from "./schema.js";

/** A topic as the stream announces it, once a connection and before its first record. */
export interface Channel {
  channel: number;
  robot: string;
  topic: string;
  type: string;
  type_hash: string;
  encoding: string;
  schema_encoding: string;
  schema: string;
}

export type ServerNotice =
  | { op: "welcome"; protocol: number; gateway_id: string; limits: Record<string, number> }
  | ({ op: "channel" } & Channel)
  | { op: "metrics"; id: number; robot: string; stamp_ms: number; values: Record<string, number | null> }
  | { op: "fleet"; id: number; robots: Robot[] }
  | { op: "dropped"; id: number; count: number; total: number }
  | { op: "error"; id?: number; code: string; message: string };
