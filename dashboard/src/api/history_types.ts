/** The shapes of what is stored: history, recordings and the store itself. Names are the wire's names. */

import type { Recording } from "./schema.js";
import type { Channel, SeriesRange } from "./types";

/** A span of time in milliseconds since the epoch. */
export interface Span {
  from_ms: number;
  to_ms: number;
}

/** A declared loss on the time axis. */
export interface Loss extends Span {
  count: number;
  reason: string;
  topic: string | null;
}

export type { History as Stored, StoredTopicState as StoredTopic } from "./schema.js";

/** How much is stored in each of equal pieces of a span, and where something is missing. */
export interface Density {
  start_ms: number;
  end_ms: number;
  width_ms: number;
  messages: number[];
  rows: number[];
  gaps: Loss[];
  offline?: Span[];
}

/** A topic of which nothing is stored at an instant. */
export interface Missing {
  topic: string;
  reason: string;
  nearest_ms: number | null;
}

/** The head of the answer to "what was there at t": binary records follow it. */
export interface AtHeader {
  t_ms: number;
  channels: Channel[];
  missing: Missing[];
  gaps: Loss[];
}

/** A stored sample, undecoded. */
export interface StoredMessage {
  topic: string;
  stamp_ms: number;
  seq: number;
  cdr: string;
}

/** Series over a span; each gap is [from_ms, to_ms, count, reason]. */
export interface Ranged {
  series: SeriesRange[];
  gaps?: [number, number, number, string][];
}

export type { Recording, StoreAccount as StoreView } from "./schema.js";
export type RecordingState = Recording["state"];
