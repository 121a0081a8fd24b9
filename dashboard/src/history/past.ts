/**
 * What a robot's topics said at an instant, for the same panels that show them live.
 *
 * Panels watch topics; each time the instant moves, one request brings the newest stored sample of every watched topic
 * (and, where a panel wants them, the samples around it). A panel is told first of the new instant, so that it forgets
 * the old one, then gets the records in the order of their stamps.
 */

import { signal } from "@preact/signals";
import { saidOf } from "../api/client";
import { historyApi } from "../api/history";
import type { AtHeader, Missing, StoredMessage } from "../api/history_types";
import type { Channel } from "../api/types";
import type { StreamRecord } from "../live/records";
import { parseSnapshot, recordOf, type Snapshot } from "./snapshot_frame";
import { Latest } from "./latest";

/** What is older than this at an instant is not shown at all. */
export const MAX_AGE_S = 60;
const MESSAGES = 300;

export interface Watch {
  topic: string;
  /** Also the samples this long before and after the instant. */
  backS: number;
  aheadS: number;
  /** A new instant begins; `missing`: nothing is stored there, and why. What came just before is shown all the same. */
  onInstant: (tMs: number, missing: Missing | null) => void;
  onRecord: (channel: Channel, record: StreamRecord) => void;
}

interface Answer {
  tMs: number;
  watches: Watch[];
  at: Snapshot;
  around: StoredMessage[];
}

/** Why nothing is there: a declared loss between the sample and the instant, else what the gateway says. */
function absence(topic: string, tMs: number, { missing, gaps }: AtHeader, sampleMs: number | null): Missing | null {
  const loss = gaps.find((gap) => gap.topic === topic && gap.from_ms <= tMs && tMs <= gap.to_ms && gap.to_ms >= (sampleMs ?? 0));
  const said = missing.find((one) => one.topic === topic) ?? { topic, reason: "not_stored", nearest_ms: sampleMs };
  if (loss) return { ...said, reason: loss.reason };
  return sampleMs === null ? said : null;
}

/** How the past is asked; a test gives its own. */
export type Asks = Pick<typeof historyApi, "at" | "messages">;

export class Past {
  /** The head of the newest answer. */
  readonly shown = signal<AtHeader | null>(null);
  readonly problem = signal("");
  #watches = new Set<Watch>();
  #tMs: number | null = null;
  #scheduled = false;
  #preview = false;
  #latest = new Latest<Answer>(
    (answer) => this.#apply(answer),
    (error) => (this.problem.value = saidOf(error)),
  );

  constructor(
    private readonly robot: string,
    private readonly asks: Asks = historyApi,
  ) {}

  /** Go to an instant; a preview waits for the one before it. */
  seek(tMs: number, { preview = false } = {}): void {
    this.#preview = preview;
    if (tMs !== this.#tMs) {
      this.#tMs = tMs;
      this.#ask();
    } else if (!preview) {
      this.#ask(); // a preview brought less
    }
  }

  watch(watch: Watch): () => void {
    this.#watches.add(watch);
    this.#schedule();
    return () => {
      this.#watches.delete(watch);
    };
  }

  close(): void {
    this.#latest.close();
  }

  /** One request for all panels that come in this turn of the event loop. */
  #schedule(): void {
    if (this.#scheduled) return;
    this.#scheduled = true;
    queueMicrotask(() => {
      if (this.#scheduled) this.#ask();
    });
  }

  #ask(): void {
    this.#scheduled = false;
    const tMs = this.#tMs;
    const watches = [...this.#watches];
    const preview = this.#preview;
    if (tMs !== null && watches.length > 0) this.#latest.ask((abort) => this.#load(tMs, watches, abort, preview), { preview });
  }

  /** A preview does without the samples around the instant. */
  async #load(tMs: number, watches: Watch[], abort: AbortSignal, preview: boolean): Promise<Answer> {
    const topics = [...new Set(watches.map(({ topic }) => topic))];
    const wide = watches.filter(({ backS, aheadS }) => backS + aheadS > 0);
    const startMs = tMs - Math.max(0, ...wide.map(({ backS }) => backS)) * 1000;
    const endMs = tMs + Math.max(0, ...wide.map(({ aheadS }) => aheadS)) * 1000;
    const named = [...new Set(wide.map(({ topic }) => topic))];
    const [body, around] = await Promise.all([
      this.asks.at(this.robot, tMs, topics, MAX_AGE_S, abort),
      wide.length > 0 && !preview ? this.asks.messages(this.robot, named, startMs, endMs, MESSAGES, abort) : [],
    ]);
    return { tMs, watches, at: parseSnapshot(body), around };
  }

  #apply({ tMs, watches, at, around }: Answer): void {
    this.problem.value = "";
    this.shown.value = at.header;
    for (const watch of watches) {
      if (!this.#watches.has(watch)) continue;
      const channel = at.channels.get(watch.topic);
      const sample = at.records.get(watch.topic);
      watch.onInstant(tMs, absence(watch.topic, tMs, at.header, sample?.stampMs ?? null));
      if (!channel || !sample) continue;
      const [from, to] = [tMs - watch.backS * 1000, tMs + watch.aheadS * 1000];
      const own = around.filter(({ topic, stamp_ms }) => topic === watch.topic && stamp_ms >= from && stamp_ms <= to);
      const records = own.map((message) => recordOf(message, channel.channel));
      if (!records.some(({ stampMs }) => Math.abs(stampMs - sample.stampMs) < 0.01)) records.push(sample);
      for (const record of records.sort((a, b) => a.stampMs - b.stampMs)) watch.onRecord(channel, record);
    }
  }
}
