/** The gateway's REST and stream shapes, as the page uses them. Names are the wire's names. */

export interface Sample {
  stamp_ms: number;
  value: number;
}

/** How much of a class waits on the robot: accepted while the link was up (fresh) or down (backfill). */
export interface ClassDepth {
  name: "event" | "metric" | "bulk" | "live";
  fresh_bytes: number;
  backfill_bytes: number;
  samples: number;
  lost: number;
  disk_bytes: number;
  quota_bytes: number;
}

export interface Gap {
  topic: string | null;
  class: Topic["class"] | null;
  stream: number;
  backfill: boolean;
  epoch: string;
  from: number;
  to: number;
  count: number;
  reason: string;
  lost_from: string | null;
  lost_to: string | null;
  declared: string;
}

export interface Uplink {
  bytes_per_s: number | null;
  sent_bytes_per_s: number;
}

export interface Robot {
  id: string;
  namespace: string;
  hostname: string;
  state: "online" | "offline";
  since: string | null;
  last_seen: string | null;
  agent_version: string;
  labels: Record<string, string>;
  link: {
    session: number;
    rtt_ms: number | null;
    outbox_bytes: number;
    outbox_samples: number;
    bytes_per_s: number;
    transport: string;
    gateway: string;
    budget_bytes_per_s: number | null;
    sent_bytes_per_s: number;
    reconnects: number;
    classes: ClassDepth[];
    disk_free_bytes: number;
    clock_offset_ms: number;
    forks: number;
    epochs: number;
  };
  channels: number;
  counts: { samples: number; bytes: number; duplicates: number; gaps: number; lost: number; over_quota?: number; put_off?: number };
  lease: { holder: string; expires_in_s: number } | null;
  latest: Record<string, Sample>;
}

export interface Topic {
  channel: number;
  topic: string;
  type: string;
  type_hash: string;
  encoding: string;
  class: "event" | "metric" | "bulk" | "live";
  forward: boolean;
  qos: string;
  rate_hz: number | null;
  bytes_per_s: number | null;
  messages: number;
  dropped: number;
  thinned: number;
  publishers: number;
  subscribers: number;
  received: number;
  received_bytes: number;
  lost: number;
  last_stamp_ms: number | null;
  demand_hz: number | null;
  history_hz: number; // of a live topic so many samples a second are stored, watched or not; 0: none
}

export interface SeriesInfo {
  name: string;
  topic: string;
  field: string;
  samples: number;
  latest: Sample | null;
}

export interface SeriesRange {
  name: string;
  stamp_ms: number[];
  mean: number[];
  min: number[];
  max: number[];
  count: number[];
}

/** RFC 9457 problem+json, with our stable code. */
export interface Problem {
  title: string;
  status: number;
  code: string;
  detail: string;
  retry_after_s?: number;
}

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
