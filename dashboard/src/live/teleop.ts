/**
 * Dead-man driving. `hold` starts, `aim` changes, `letGo` ends; while held a drive goes out ten times a second.
 *
 * The stop is sent the moment the hold ends, whatever ended it. A drive needs a granted lease, and acknowledgements:
 * when none comes for ACK_LIMIT_MS, or the socket closes, the hold is over and has to be begun again. After
 * IDLE_RELEASE_MS without a hold the lease is given back, so that the robot goes on with its own work.
 */

import { signal } from "@preact/signals";
import type { SocketLike } from "./stream";

export const PERIOD_MS = 100;
export const ACK_LIMIT_MS = 600;
export const IDLE_RELEASE_MS = 3000;

export type TeleopState = "idle" | "asking" | "holding" | "armed" | "refused" | "lost";

export interface Aim {
  linear: number;
  angular: number;
}

type Reply =
  | { op: "granted"; lease_id: string; expires_in_s: number; topic: string }
  | { op: "refused"; code: string; holder?: string }
  | { op: "ack"; seq: number; rtt_ms?: number | null }
  | { op: "error"; code: string; message?: string };

export class Teleop {
  readonly state = signal<TeleopState>("idle");
  readonly rttMs = signal<number | null>(null);
  readonly detail = signal("");
  readonly topic = signal("");
  readonly sent = signal(0);
  #socket: SocketLike | null = null;
  #granted = false;
  #held = false;
  #aim: Aim = { linear: 0, angular: 0 };
  #seq = 0;
  #lastAckMs = 0;
  #timer: ReturnType<typeof setInterval> | undefined;
  #idle: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly connect: () => SocketLike,
    private readonly holder: string,
    private readonly nowMs: () => number = () => performance.now(),
  ) {}

  hold(aim: Aim): void {
    this.#aim = aim;
    if (this.#held) return;
    this.#held = true;
    clearTimeout(this.#idle);
    if (this.#granted) this.#begin();
    else if (!this.#socket) this.#take();
  }

  aim(aim: Aim): void {
    this.#aim = aim;
  }

  letGo(): void {
    if (!this.#held) return;
    this.#held = false;
    clearInterval(this.#timer);
    this.#send({ op: "stop" });
    if (this.#granted) this.state.value = "armed";
    this.#idle = setTimeout(() => this.release(), IDLE_RELEASE_MS);
  }

  /** Stop, give the lease back and close. */
  release(): void {
    this.#send({ op: "stop" });
    this.#send({ op: "release" });
    this.#finish("idle", "");
  }

  #take(): void {
    this.state.value = "asking";
    this.detail.value = "";
    const socket = this.connect();
    this.#socket = socket;
    socket.onopen = () => socket.send(JSON.stringify({ op: "take", holder: this.holder }));
    socket.onmessage = (event) => this.#reply(JSON.parse(String(event.data)) as Reply);
    socket.onclose = () => {
      if (this.#socket === socket) this.#finish("lost", "the link was lost; the robot stops by itself");
    };
  }

  #reply(reply: Reply): void {
    if (reply.op === "granted") {
      this.#granted = true;
      this.topic.value = reply.topic;
      if (this.#held) this.#begin();
      else this.state.value = "armed";
    } else if (reply.op === "ack") {
      this.#lastAckMs = this.nowMs();
      if (reply.rtt_ms != null) this.rttMs.value = reply.rtt_ms;
    } else if (reply.op === "refused") {
      this.#finish("refused", reply.holder ? `${reply.holder} is driving` : reply.code);
    } else {
      this.#finish("refused", reply.message ?? reply.code);
    }
  }

  #begin(): void {
    this.state.value = "holding";
    this.#lastAckMs = this.nowMs();
    clearInterval(this.#timer);
    this.#timer = setInterval(() => this.#drive(), PERIOD_MS);
    this.#drive();
  }

  #drive(): void {
    if (this.nowMs() - this.#lastAckMs > ACK_LIMIT_MS) {
      this.#send({ op: "stop" });
      this.#finish("lost", "no answer from the robot; stopped");
      return;
    }
    this.#seq += 1;
    this.#send({ op: "drive", ...this.#aim, seq: this.#seq });
    this.sent.value = this.#seq;
  }

  #send(message: object): void {
    if (this.#granted) this.#socket?.send(JSON.stringify(message));
  }

  #finish(state: TeleopState, detail: string): void {
    clearInterval(this.#timer);
    clearTimeout(this.#idle);
    const socket = this.#socket;
    this.#socket = null;
    this.#granted = false;
    this.#held = false;
    this.rttMs.value = null;
    this.state.value = state;
    this.detail.value = detail;
    socket?.close();
  }
}
