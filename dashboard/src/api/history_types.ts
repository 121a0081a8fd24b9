/** The shapes of what is stored: history, recordings and the store itself. Names are the wire's names. */

import type { Channel, SeriesRange, Topic } from "./types";

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

export interface StoredTopic {
  topic: string;
  type: string;
  class: Topic["class"];
  samples: number;
  bytes: number;
  first: string | null;
  last: string | null;
}

/** What the store has of a robot. */
export interface Stored {
  topics: StoredTopic[];
  series: number;
  first: string | null;
  last: string | null;
}

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

export type RecordingState = "requested" | "cutting" | "transferring" | "stored" | "failed";

export interface Recording {
  id: string;
  robot: string;
  state: RecordingState;
  start: string;
  end: string;
  requested: string;
  size_bytes: number | null;
  received_bytes: number | null;
  messages: number | null;
  code: string | null;
  message: string | null;
}

/** The store as a whole; null where it is not known, or not limited. */
export interface StoreView {
  total_bytes: number;
  disk_free_bytes: number | null;
  growth_bytes_per_day: number | null;
  days_until_full: number | null;
  /** The bound of everything together, and when it is reached: then the oldest goes. */
  keep_bytes: number | null;
  days_until_bound: number | null;
  classes: { class: string; bytes: number; oldest: string | null; keep_days: number | null; keep_bytes: number | null }[];
  robots: { robot: string; bytes: number }[];
  damaged: { object: string; robot: string | null; topic: string | null; start: string | null; end: string | null }[];
}
