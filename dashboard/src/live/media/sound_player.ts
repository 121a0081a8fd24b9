/** Plays packets of sound: Opus by WebCodecs, PCM as it is, through a worklet with a jitter buffer. Made at a click. */

import { signal } from "@preact/signals";
import { mixed, type SoundPacket } from "./sound";
import workletUrl from "./sound.worklet.ts?worker&url";

/** WebCodecs gives what it decodes of Opus with this rate. */
const OPUS_RATE = 48_000;
/** Packets that may wait in the decoder. */
const MAX_WAITING = 25;
/** After so long without a packet nothing plays. */
const SILENT_MS = 1000;
/** A stream that cannot be decoded is tried again so often: browsers allow a page few audio contexts. */
const AGAIN_MS = 1000;

export const canOpus = () => typeof AudioDecoder !== "undefined";

export class SoundPlayer {
  /** From capture to loudspeaker, by both clocks; null while nothing plays. */
  readonly latencyMs = signal<number | null>(null);
  /** The highest sample lately, 0 to 1. */
  readonly peak = signal(0);
  readonly skippedMs = signal(0);
  readonly problem = signal("");
  #context: AudioContext | null = null;
  #gain: GainNode | null = null;
  #node: AudioWorkletNode | null = null;
  #decoder: AudioDecoder | null = null;
  #shape = "";
  #volume = 1;
  #lastMs = 0;
  #heardMs = 0;
  #notBeforeMs = 0;

  push(packet: SoundPacket): void {
    const rate = packet.codec === "opus" ? OPUS_RATE : packet.rate;
    const shape = `${packet.codec} ${rate} ${packet.channels}`;
    if (shape !== this.#shape && Date.now() >= this.#notBeforeMs) void this.#begin(shape, rate, packet);
    if (!this.#node) return;
    [this.#lastMs, this.#heardMs] = [packet.stampMs, Date.now()];
    if (packet.codec === "pcm-s16") this.#play(mixed(packet));
    else this.#decode(packet);
  }

  volume(value: number): void {
    this.#volume = value;
    if (this.#gain) this.#gain.gain.value = value;
  }

  close(): void {
    this.#shape = "";
    this.#node?.disconnect();
    this.#node = null;
    if (this.#decoder && this.#decoder.state !== "closed") this.#decoder.close();
    this.#decoder = null;
    void this.#context?.close();
    this.#context = null;
    this.latencyMs.value = null;
    this.peak.value = 0;
  }

  async #begin(shape: string, rate: number, packet: SoundPacket): Promise<void> {
    this.close();
    this.#shape = shape;
    const context = (this.#context = new AudioContext({ sampleRate: rate, latencyHint: "interactive" }));
    try {
      await context.audioWorklet.addModule(workletUrl);
    } catch (error) {
      this.problem.value = `no sound here: ${String(error)}`;
      return;
    }
    if (this.#context !== context) return;
    const node = new AudioWorkletNode(context, "metaros-player", { numberOfInputs: 0, outputChannelCount: [1] });
    const gain = (this.#gain = new GainNode(context, { gain: this.#volume }));
    node.connect(gain).connect(context.destination);
    node.port.onmessage = ({ data }) => {
      if (this.#node === node) this.#told(data as { waitingMs: number; peak: number; skippedMs: number }); // not once it is closed
    };
    if (packet.codec === "opus") this.#decoder = this.#newDecoder(packet.channels);
    this.#node = node;
    this.problem.value = "";
    await context.resume();
  }

  #newDecoder(channels: number): AudioDecoder {
    const decoder = new AudioDecoder({
      output: (sound) => {
        this.#play(monoOf(sound));
        sound.close();
      },
      error: (error) => {
        this.problem.value = `the sound cannot be decoded: ${error.message}`;
        this.#shape = "";
        this.#notBeforeMs = Date.now() + AGAIN_MS;
      },
    });
    decoder.configure({ codec: "opus", sampleRate: OPUS_RATE, numberOfChannels: channels });
    return decoder;
  }

  #decode(packet: SoundPacket): void {
    const decoder = this.#decoder;
    if (!decoder || decoder.state !== "configured" || decoder.decodeQueueSize > MAX_WAITING) return;
    decoder.decode(new EncodedAudioChunk({ type: "key", timestamp: packet.stampMs * 1000, data: packet.data }));
  }

  #play(samples: Float32Array<ArrayBuffer>): void {
    this.#node?.port.postMessage(samples, [samples.buffer]);
  }

  #told({ waitingMs, peak, skippedMs }: { waitingMs: number; peak: number; skippedMs: number }): void {
    this.peak.value = peak;
    this.skippedMs.value = skippedMs;
    const device = 1000 * ((this.#context?.baseLatency ?? 0) + (this.#context?.outputLatency ?? 0));
    const now = Date.now();
    if (now - this.#heardMs > SILENT_MS || this.#lastMs === 0) this.latencyMs.value = null;
    else if (waitingMs > 0) this.latencyMs.value = Math.max(0, this.#heardMs - this.#lastMs) + waitingMs + device;
  }
}

/** What was decoded, as one channel. */
function monoOf(sound: AudioData): Float32Array<ArrayBuffer> {
  const made = new Float32Array(sound.numberOfFrames);
  const plane = new Float32Array(sound.numberOfFrames);
  for (let channel = 0; channel < sound.numberOfChannels; channel++) {
    sound.copyTo(plane, { planeIndex: channel, format: "f32-planar" });
    for (let at = 0; at < made.length; at++) made[at]! += plane[at]! / sound.numberOfChannels;
  }
  return made;
}
