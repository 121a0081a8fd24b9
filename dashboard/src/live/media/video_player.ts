/**
 * H.264 chunks to frames by WebCodecs, for live video.
 *
 * A decoder begins at a key frame; when a chunk is missing, the decoder falls behind or fails, the player waits for the
 * next key frame and shows the last picture meanwhile. Where none comes for long it asks for one (`onAsk`).
 */

import { inspect, type AccessUnit } from "./h264";

/** Chunks that may wait in the decoder; more and it is too slow: on to the next key frame. */
export const MAX_WAITING = 6;
/** A key frame comes within its group's two seconds; later it is asked for, and at most once in so long. */
export const KEY_WAIT_MS = 2500;
/** So many failures without a picture between them are told. */
const TOLD_FAILURES = 3;

export interface VideoChunk {
  data: Uint8Array<ArrayBuffer>;
  takenMs: number;
  seq: number;
}

export interface VideoEvents {
  /** The frame is the receiver's: it has to close it. */
  onFrame: (frame: VideoFrame, takenMs: number) => void;
  /** Ask the robot for a key frame. */
  onAsk: () => void;
  /** What is wrong, in words; "" when it is well again. */
  onProblem: (words: string) => void;
}

/** The part of WebCodecs that is used, so that a test can be the other end. */
export interface Codecs {
  decoder: (init: VideoDecoderInit) => Pick<VideoDecoder, "configure" | "decode" | "close" | "state" | "decodeQueueSize">;
  chunk: (init: EncodedVideoChunkInit) => EncodedVideoChunk;
}

export const browserCodecs: Codecs = {
  decoder: (init) => new VideoDecoder(init),
  chunk: (init) => new EncodedVideoChunk(init),
};

export class VideoPlayer {
  /** Chunks that were not decoded since the decoder was behind. */
  skipped = 0;
  #decoder: ReturnType<Codecs["decoder"]> | null = null;
  #parameters = "";
  #lastSeq: number | null = null;
  #waitsSinceMs: number | null = 0;
  #askedMs = -Infinity;
  #failures = 0;

  constructor(
    private readonly events: VideoEvents,
    private readonly codecs: Codecs = browserCodecs,
    private readonly nowMs: () => number = () => performance.now(),
    private readonly maxWaiting = MAX_WAITING,
  ) {
    this.#waitsSinceMs = nowMs();
  }

  /** Nothing can be shown before a key frame comes. */
  get waits(): boolean {
    return this.#waitsSinceMs !== null;
  }

  push(chunk: VideoChunk): void {
    const unit = inspect(chunk.data);
    const missed = this.#lastSeq !== null && chunk.seq !== this.#lastSeq + 1;
    this.#lastSeq = chunk.seq;
    if (missed) this.#wait();
    if (missed && !unit.key) this.#ask(); // the gateway goes on with a key frame: this page dropped it
    if ((this.#decoder?.decodeQueueSize ?? 0) >= this.maxWaiting) this.#fallBehind();
    if (this.waits && !unit.key) return this.#missKey();
    try {
      this.#decode(chunk, unit);
    } catch (error) {
      this.#fail(error);
    }
  }

  /** Forget everything: what comes next belongs to another stream or instant. */
  restart(): void {
    this.#drop();
    this.#lastSeq = null;
    this.#failures = 0;
    this.#wait();
  }

  close(): void {
    this.#drop();
  }

  #decode({ data, takenMs }: VideoChunk, { key, codec, parameters }: AccessUnit): void {
    if (codec && (!this.#decoder || parameters !== this.#parameters)) {
      this.#decoder ??= this.#made();
      this.#decoder.configure({ codec, optimizeForLatency: true });
      this.#parameters = parameters;
    }
    if (!this.#decoder) return this.#missKey(); // a key frame without parameters
    this.#decoder.decode(this.codecs.chunk({ type: key ? "key" : "delta", timestamp: Math.round(takenMs * 1000), data }));
    this.#waitsSinceMs = null;
  }

  #made(): ReturnType<Codecs["decoder"]> {
    const made = this.codecs.decoder({
      output: (frame) => {
        if (made !== this.#decoder) return frame.close();
        this.#failures = 0;
        this.events.onProblem("");
        this.events.onFrame(frame, frame.timestamp / 1000);
      },
      error: (error) => made === this.#decoder && this.#fail(error),
    });
    return made;
  }

  #fail(error: unknown): void {
    this.#drop();
    this.#wait();
    this.#failures += 1;
    if (this.#failures >= TOLD_FAILURES) this.events.onProblem(`This browser cannot decode it: ${error instanceof Error ? error.message : String(error)}`);
    this.#ask();
  }

  #fallBehind(): void {
    this.skipped += 1;
    this.#drop(); // what waits in it is late already
    this.#wait();
    this.#ask();
  }

  #missKey(): void {
    if (this.nowMs() - this.#waitsSinceMs! > KEY_WAIT_MS) this.#ask();
  }

  #ask(): void {
    if (this.nowMs() - this.#askedMs < KEY_WAIT_MS) return;
    this.#askedMs = this.nowMs();
    this.events.onAsk();
  }

  #wait(): void {
    this.#waitsSinceMs ??= this.nowMs();
  }

  #drop(): void {
    const decoder = this.#decoder;
    this.#decoder = null;
    this.#parameters = "";
    if (decoder && decoder.state !== "closed") decoder.close();
  }
}
