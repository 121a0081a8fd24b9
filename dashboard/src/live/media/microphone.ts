/** The person's microphone as packets of 20 ms: Opus where the browser encodes it, else 16-bit PCM. */

import { asPcm } from "./sound";
import workletUrl from "./sound.worklet.ts?worker&url";

export interface Coding {
  codec: "opus" | "pcm-s16";
  rate: number;
}

export interface Microphone {
  close: () => void;
}

const OPUS: AudioEncoderConfig = { codec: "opus", sampleRate: 48_000, numberOfChannels: 1, bitrate: 32_000, opus: { frameDuration: 20_000 } };
/** Packets that may wait in the encoder: later speech is worth nothing. */
const MAX_WAITING = 10;

/** What this browser can send. */
export async function bestCoding(): Promise<Coding> {
  const opus = typeof AudioEncoder !== "undefined" && (await AudioEncoder.isConfigSupported(OPUS)).supported;
  return opus ? { codec: "opus", rate: 48_000 } : { codec: "pcm-s16", rate: 16_000 };
}

/** Open it, which asks the person; throws where they say no, or there is none. `onPacket` hears until it is closed. */
export async function openMicrophone(coding: Coding, onPacket: (data: ArrayBuffer) => void): Promise<Microphone> {
  if (!navigator.mediaDevices) throw new Error("Browsers let pages hear only where they came by https, or from localhost.");
  const stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true, noiseSuppression: false, autoGainControl: false } });
  const context = new AudioContext({ sampleRate: coding.rate, latencyHint: "interactive" });
  const encoder = coding.codec === "opus" ? opusEncoder(onPacket) : null;
  const close = () => {
    if (encoder && encoder.state !== "closed") encoder.close();
    stream.getTracks().forEach((track) => track.stop());
    void context.close();
  };
  try {
    await context.audioWorklet.addModule(workletUrl);
    const node = new AudioWorkletNode(context, "metaros-microphone", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
    const take = encoder ? opusOf(encoder) : (piece: Float32Array<ArrayBuffer>) => onPacket(asPcm(piece));
    node.port.onmessage = ({ data }) => take(data as Float32Array<ArrayBuffer>);
    context.createMediaStreamSource(stream).connect(node);
    await context.resume();
  } catch (error) {
    close();
    throw error;
  }
  return { close };
}

function opusEncoder(onPacket: (data: ArrayBuffer) => void): AudioEncoder {
  const encoder = new AudioEncoder({
    output: (chunk) => {
      const data = new ArrayBuffer(chunk.byteLength);
      chunk.copyTo(data);
      onPacket(data);
    },
    error: () => undefined, // it is closed then, and nothing more is said
  });
  encoder.configure(OPUS);
  return encoder;
}

function opusOf(encoder: AudioEncoder): (piece: Float32Array<ArrayBuffer>) => void {
  let samples = 0;
  return (piece) => {
    if (encoder.state !== "configured" || encoder.encodeQueueSize > MAX_WAITING) return;
    const timestamp = (1e6 * samples) / OPUS.sampleRate;
    samples += piece.length;
    const sound = new AudioData({ format: "f32", sampleRate: OPUS.sampleRate, numberOfFrames: piece.length, numberOfChannels: 1, timestamp, data: piece });
    encoder.encode(sound);
    sound.close();
  };
}
