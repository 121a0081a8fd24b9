/**
 * The two ends of the page's sound on the browser's audio thread: a player with a small jitter buffer, and a microphone
 * that gives pieces of 20 ms. One channel; samples are floats.
 */

declare abstract class AudioWorkletProcessor {
  readonly port: MessagePort;
  abstract process(inputs: Float32Array[][], outputs: Float32Array[][]): boolean;
}
declare function registerProcessor(name: string, make: new () => AudioWorkletProcessor): void;
declare const sampleRate: number;

/** Gathered before it begins, and again when it ran dry. */
const START_S = 0.06;
/** More than so much waits: the oldest is skipped. */
const MOST_S = 0.3;
const PIECE_S = 0.02;
const TELL_S = 0.1;

class Player extends AudioWorkletProcessor {
  #waiting: Float32Array[] = [];
  #at = 0;
  #samples = 0;
  #playing = false;
  #skipped = 0;
  #peak = 0;
  #sinceTold = 0;

  constructor() {
    super();
    this.port.onmessage = ({ data }) => this.#push(data as Float32Array);
  }

  process(_inputs: Float32Array[][], [output]: Float32Array[][]): boolean {
    const to = output![0]!;
    if (!this.#playing) this.#playing = this.#samples >= START_S * sampleRate;
    for (let at = 0; this.#playing && at < to.length; at++) {
      if (this.#samples === 0) {
        this.#playing = false;
        break;
      }
      const value = this.#next();
      to[at] = value;
      this.#peak = Math.max(this.#peak, Math.abs(value));
    }
    this.#sinceTold += to.length;
    if (this.#sinceTold >= TELL_S * sampleRate) {
      this.port.postMessage({ waitingMs: (1000 * this.#samples) / sampleRate, peak: this.#peak, skippedMs: (1000 * this.#skipped) / sampleRate });
      [this.#sinceTold, this.#peak] = [0, 0];
    }
    return true;
  }

  #push(piece: Float32Array): void {
    this.#waiting.push(piece);
    this.#samples += piece.length;
    if (this.#samples <= MOST_S * sampleRate) return;
    while (this.#samples > START_S * sampleRate) {
      this.#next();
      this.#skipped += 1;
    }
  }

  #next(): number {
    const piece = this.#waiting[0]!;
    const value = piece[this.#at] ?? 0;
    this.#at += 1;
    this.#samples -= 1;
    if (this.#at >= piece.length) {
      this.#waiting.shift();
      this.#at = 0;
    }
    return value;
  }
}

class Microphone extends AudioWorkletProcessor {
  #piece = new Float32Array(Math.round(PIECE_S * sampleRate));
  #filled = 0;

  process([input]: Float32Array[][]): boolean {
    for (const value of input?.[0] ?? []) {
      this.#piece[this.#filled] = value;
      this.#filled += 1;
      if (this.#filled < this.#piece.length) continue;
      this.port.postMessage(this.#piece, [this.#piece.buffer]);
      this.#piece = new Float32Array(Math.round(PIECE_S * sampleRate));
      this.#filled = 0;
    }
    return true;
  }
}

registerProcessor("metaros-player", Player);
registerProcessor("metaros-microphone", Microphone);
