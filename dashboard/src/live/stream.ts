/**
 * One multiplexed WebSocket for everything live on the page.
 *
 * Callers subscribe and get a function that ends the subscription. When the connection is lost the stream reconnects
 * by itself and subscribes again; callers notice nothing but a pause. Nothing is queued here: records go to their
 * subscriber as they come, and a slow consumer drops on its own side (live/decoder.ts).
 */

import { signal } from "@preact/signals";
import type { Channel, Robot, ServerNotice } from "../api/types";
import { Backoff } from "./backoff";
import { parseFrame, type StreamRecord } from "./records";

export type StreamState = "connecting" | "open" | "lost";
export type Unsubscribe = () => void;

export interface TopicRequest {
  robots: string;
  topics: string;
  max_rate_hz?: number;
  mode?: "latest" | "queue";
  queue_bytes?: number;
}

export interface MetricsRequest {
  robots: string;
  series: string[];
  max_rate_hz?: number;
}

export type MetricsHandler = (robot: string, stampMs: number, values: Record<string, number | null>) => void;
export type RecordHandler = (channel: Channel, record: StreamRecord) => void;
/** `complete`: these are all the robots there are, not only the changed ones. */
export type FleetHandler = (robots: Robot[], complete: boolean) => void;

interface Subscription {
  request: Record<string, unknown>;
  onRecord?: RecordHandler;
  onMetrics?: MetricsHandler;
  onFleet?: FleetHandler;
  fresh: boolean;
}

/** The part of WebSocket that the stream uses, so that a test can be the other end. */
export interface SocketLike {
  binaryType: string;
  onopen: ((event: Event) => void) | null;
  onclose: ((event: CloseEvent) => void) | null;
  onmessage: ((event: MessageEvent) => void) | null;
  send(text: string): void;
  close(): void;
}

export class Stream {
  readonly state = signal<StreamState>("connecting");
  /** Samples the gateway dropped because this page was slow, and frames this page could not read. */
  readonly dropped = signal(0);
  #socket: SocketLike | null = null;
  #open = false;
  #nextId = 1;
  #subscriptions = new Map<number, Subscription>();
  #channels = new Map<number, Channel>();
  #backoff = new Backoff();
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly connect: () => SocketLike) {}

  start(): void {
    clearTimeout(this.#timer);
    const socket = this.connect();
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.#socket === socket && this.#opened();
    socket.onmessage = (event) => this.#socket === socket && this.#received(event.data);
    socket.onclose = () => this.#socket === socket && this.#closed();
    this.#socket = socket;
  }

  /** End the connection; there is no other before the next start. Subscriptions stay. */
  stop(): void {
    clearTimeout(this.#timer);
    const socket = this.#socket;
    this.#socket = null;
    this.#open = false;
    this.state.value = "connecting";
    socket?.close();
  }

  topic(request: TopicRequest, onRecord: RecordHandler): Unsubscribe {
    return this.#add({ request: { op: "subscribe", ...request }, onRecord, fresh: true });
  }

  metrics(request: MetricsRequest, onMetrics: MetricsHandler): Unsubscribe {
    return this.#add({ request: { op: "subscribe_metrics", ...request }, onMetrics, fresh: true });
  }

  fleet(onFleet: FleetHandler): Unsubscribe {
    return this.#add({ request: { op: "subscribe_fleet" }, onFleet, fresh: true });
  }

  #add(subscription: Subscription): Unsubscribe {
    const id = this.#nextId++;
    subscription.request.id = id;
    this.#subscriptions.set(id, subscription);
    this.#send(subscription.request);
    return () => {
      if (this.#subscriptions.delete(id)) this.#send({ op: "unsubscribe", id });
    };
  }

  #send(message: object): void {
    if (this.#open) this.#socket?.send(JSON.stringify(message));
  }

  #opened(): void {
    this.#open = true;
    this.#channels.clear();
    this.#backoff.reset();
    this.state.value = "open";
    for (const subscription of this.#subscriptions.values()) {
      subscription.fresh = true;
      this.#send(subscription.request);
    }
  }

  #closed(): void {
    this.#open = false;
    this.state.value = "lost";
    this.#timer = setTimeout(() => this.start(), this.#backoff.next());
  }

  #received(data: unknown): void {
    try {
      if (data instanceof ArrayBuffer) this.#records(data);
      else this.#notice(JSON.parse(String(data)) as ServerNotice);
    } catch {
      this.dropped.value += 1;
    }
  }

  #records(frame: ArrayBuffer): void {
    for (const record of parseFrame(frame)) {
      const channel = this.#channels.get(record.channel);
      const handler = this.#subscriptions.get(record.subscription)?.onRecord;
      if (channel && handler) handler(channel, record);
    }
  }

  #notice(notice: ServerNotice): void {
    switch (notice.op) {
      case "channel":
        this.#channels.set(notice.channel, notice);
        break;
      case "metrics":
        this.#subscriptions.get(notice.id)?.onMetrics?.(notice.robot, notice.stamp_ms, notice.values);
        break;
      case "fleet": {
        const subscription = this.#subscriptions.get(notice.id);
        subscription?.onFleet?.(notice.robots, subscription.fresh);
        if (subscription) subscription.fresh = false;
        break;
      }
      case "dropped":
        this.dropped.value += notice.count;
        break;
      case "error":
        console.warn(`stream: ${notice.code}: ${notice.message}`);
        break;
    }
  }
}
