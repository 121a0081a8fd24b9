/**
 * Push to talk. `hold` opens the microphone and takes the lease, `letGo` ends the word at once, `release` gives all back.
 *
 * Sound goes out only while it is held, the lease is granted and the microphone is open. The gateway acknowledges
 * packets: when none comes for ACK_LIMIT_MS the hold is over. After IDLE_RELEASE_MS without a hold the lease and the
 * microphone are given back.
 */

import { signal } from "@preact/signals";
import type { Coding, Microphone } from "./microphone";

export const ACK_LIMIT_MS = 2000;
export const IDLE_RELEASE_MS = 3000;

export type TalkState = "idle" | "asking" | "talking" | "armed" | "refused" | "lost";

/** The part of WebSocket that is used. */
export interface TalkSocket {
  onopen: ((event: Event) => void) | null;
  onclose: ((event: CloseEvent) => void) | null;
  onmessage: ((event: MessageEvent) => void) | null;
  send(data: string | ArrayBuffer): void;
  close(): void;
}

type Reply =
  | { op: "granted" }
  | { op: "released" }
  | { op: "ack"; seq: number; rtt_ms?: number | null }
  | { op: "refused" | "lost"; code: string; message?: string; holder?: string }
  | { op: "error"; code: string; message?: string };

export interface TalkParts {
  connect: () => TalkSocket;
  coding: () => Promise<Coding>;
  open: (coding: Coding, onPacket: (data: ArrayBuffer) => void) => Promise<Microphone>;
}

export class Talk {
  readonly state = signal<TalkState>("idle");
  readonly detail = signal("");
  readonly sent = signal(0);
  #socket: TalkSocket | null = null;
  #microphone: Microphone | null = null;
  #granted = false;
  #held = false;
  #taking = false;
  #lastAckMs = 0;
  #idle: ReturnType<typeof setTimeout> | undefined;
  /** Grows when all is given back: what was on its way then is not taken. */
  #round = 0;

  constructor(
    private readonly parts: TalkParts,
    private readonly holder: string,
    private readonly nowMs: () => number = () => performance.now(),
  ) {}

  hold(): void {
    if (this.#held) return;
    this.#held = true;
    clearTimeout(this.#idle);
    if (this.#socket) this.#begin();
    else if (!this.#taking) void this.#take(); // one that is under way is this one's
  }

  letGo(): void {
    if (!this.#held) return;
    this.#held = false;
    if (this.#granted) this.#socket?.send(JSON.stringify({ op: "stop" }));
    if (this.state.value === "talking") this.state.value = "armed";
    this.#idle = setTimeout(() => this.release(), IDLE_RELEASE_MS);
  }

  release(): void {
    if (this.#granted) this.#socket?.send(JSON.stringify({ op: "release" }));
    this.#finish("idle", "");
  }

  async #take(): Promise<void> {
    const round = this.#round;
    this.#taking = true;
    this.state.value = "asking";
    this.detail.value = "";
    let microphone: Microphone;
    let coding: Coding;
    try {
      coding = await this.parts.coding();
      microphone = await this.parts.open(coding, (data) => this.#say(data));
    } catch (error) {
      if (round === this.#round) this.#finish("refused", error instanceof Error ? error.message : String(error));
      return;
    }
    if (round !== this.#round) return microphone.close();
    this.#taking = false;
    this.#microphone = microphone;
    const socket = (this.#socket = this.parts.connect());
    socket.onopen = () => socket.send(JSON.stringify({ op: "take", holder: this.holder, codec: coding.codec, sample_rate: coding.rate }));
    socket.onmessage = (event) => this.#reply(JSON.parse(String(event.data)) as Reply);
    socket.onclose = () => {
      if (this.#socket === socket) this.#finish("lost", "the link was lost; the robot's speaker is silent");
    };
  }

  #reply(reply: Reply): void {
    if (reply.op === "granted") {
      this.#granted = true;
      this.#begin();
    } else if (reply.op === "ack") this.#lastAckMs = this.nowMs();
    else if (reply.op === "error") this.#finish("refused", reply.message ?? reply.code);
    else if (reply.op !== "released") this.#finish(reply.op, reply.holder ? `${reply.holder} is talking` : (reply.message ?? reply.code));
  }

  #begin(): void {
    if (!this.#granted) return;
    this.#lastAckMs = this.nowMs();
    this.state.value = this.#held ? "talking" : "armed";
  }

  #say(data: ArrayBuffer): void {
    if (!this.#held || !this.#granted) return;
    if (this.nowMs() - this.#lastAckMs > ACK_LIMIT_MS) return this.#finish("lost", "no answer from the gateway; silent");
    this.#socket?.send(data);
    this.sent.value += 1;
  }

  #finish(state: TalkState, detail: string): void {
    this.#round += 1;
    clearTimeout(this.#idle);
    const socket = this.#socket;
    this.#socket = null;
    this.#microphone?.close();
    this.#microphone = null;
    this.#granted = this.#held = this.#taking = false;
    this.state.value = state;
    this.detail.value = detail;
    socket?.close();
  }
}
