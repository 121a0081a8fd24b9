/**
 * The page's side of the decode worker, with back-pressure.
 *
 * Each feed has one message in the worker at a time (`ahead` allows more). What arrives meanwhile waits: one newest message in a feed of
 * depth 1, up to `depth` in arrival order otherwise. When there is no room the oldest waiting one is dropped, or all of
 * them where messages build on each other: of a video that is behind nothing is worth showing but what comes next.
 */

import type { Channel } from "../../api/types";
import { SEALED_CDR } from "../../seal/encoding";
import type { Origin } from "../../seal/envelope";
import type { Cloud } from "./cloud";
import type { StreamRecord } from "../records";

export type Message = Record<string, unknown>;

export type Order =
  | { kind: "schema"; key: string; schema: string }
  | { kind: "keyring"; text: string }
  | { kind: "decode"; key: string; ticket: number; image: boolean; cloud: boolean; payload: ArrayBuffer; sealed?: { origin: Origin; seq: number } };

/** `takenMs`: a picture's own stamp, when it was taken; 0 if it says nothing. */
export type Answer = { ticket: number; message?: Message; bitmap?: ImageBitmap; takenMs?: number; cloud?: Cloud; error?: string };

export interface Decoded {
  channel: Channel;
  stampMs: number;
  seq: number;
  sizeBytes: number;
  message?: Message;
  bitmap?: ImageBitmap;
  takenMs?: number;
  cloud?: Cloud;
  error?: string;
}

/** The part of Worker that the decoder uses. */
export interface WorkerLike {
  onmessage: ((event: MessageEvent) => void) | null;
  postMessage(message: Order, transfer: Transferable[]): void;
}

/** A worker that begins when there is something to do: a page without messages does without its code. */
export function onDemand(make: () => WorkerLike): WorkerLike {
  let worker: WorkerLike | null = null;
  const lazy: WorkerLike = {
    onmessage: null,
    postMessage: (message, transfer) => {
      if (!worker) {
        worker = make();
        worker.onmessage = (event) => lazy.onmessage?.(event);
      }
      worker.postMessage(message, transfer);
    },
  };
  return lazy;
}

interface Waiting {
  channel: Channel;
  stampMs: number;
  seq: number;
  sizeBytes: number;
  payload: ArrayBuffer;
}

export interface FeedOptions {
  depth: number;
  image: boolean;
  /** Points as typed arrays, in place of the message. */
  cloud?: boolean;
  /** How many messages may be in the worker at once; pictures of more than one may come out of order. */
  ahead?: number;
  /** Messages build on each other, as those of a video do. */
  chained?: boolean;
}

export class Decoder {
  #known = new Set<string>();
  #tickets = new Map<number, (answer: Answer) => void>();
  #nextTicket = 1;

  constructor(private readonly worker: WorkerLike) {
    worker.onmessage = (event: MessageEvent<Answer>) => {
      const done = this.#tickets.get(event.data.ticket);
      this.#tickets.delete(event.data.ticket);
      done?.(event.data);
    };
  }

  /** A place to push records of one subscription; `onDecoded` is called in arrival order. */
  feed(options: FeedOptions, onDecoded: (decoded: Decoded) => void): Feed {
    return new Feed(this, options, onDecoded);
  }

  /** Open sealed messages with this keyring's text from now on; the ids of its keys, or SealError. It stays in this page. */
  async unlock(text: string): Promise<string[]> {
    const { Keyring } = await import("../../seal/envelope"); // few pages ever open anything
    const { ids } = await Keyring.parse(text);
    this.worker.postMessage({ kind: "keyring", text }, []);
    return ids;
  }

  decode(waiting: Waiting, { image, cloud = false }: FeedOptions, done: (answer: Answer) => void): void {
    const { channel, payload, seq } = waiting;
    const key = `${channel.type}|${channel.type_hash}|${channel.schema.length}`;
    if (!this.#known.has(key)) {
      this.#known.add(key);
      this.worker.postMessage({ kind: "schema", key, schema: channel.schema }, []);
    }
    const ticket = this.#nextTicket++;
    this.#tickets.set(ticket, done);
    const { robot, topic, type, type_hash } = channel;
    const sealed = channel.encoding === SEALED_CDR ? { origin: { robot, topic, type, type_hash }, seq } : undefined;
    this.worker.postMessage({ kind: "decode", key, ticket, image, cloud, payload, sealed }, [payload]);
  }
}

export class Feed {
  dropped = 0;
  #waiting: Waiting[] = [];
  #busy = 0;
  #closed = false;

  constructor(
    private readonly decoder: Decoder,
    private readonly options: FeedOptions,
    private readonly onDecoded: (decoded: Decoded) => void,
  ) {}

  push(channel: Channel, record: StreamRecord): void {
    const payload = record.payload.slice().buffer;
    this.#waiting.push({ channel, stampMs: record.stampMs, seq: record.seq, sizeBytes: payload.byteLength, payload });
    if (this.#waiting.length > this.options.depth) {
      this.dropped += this.#waiting.splice(0, this.options.chained ? this.#waiting.length : 1).length;
    }
    this.#advance();
  }

  close(): void {
    this.#closed = true;
    this.#waiting = [];
  }

  #advance(): void {
    const next = this.#busy >= (this.options.ahead ?? 1) ? undefined : this.#waiting.shift();
    if (!next) return;
    this.#busy += 1;
    this.decoder.decode(next, this.options, (answer) => {
      this.#busy -= 1;
      if (this.#closed) answer.bitmap?.close();
      else this.onDecoded({ ...next, ...answer });
      this.#advance();
    });
  }
}
