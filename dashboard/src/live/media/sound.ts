/** What messages of sound say, checked: they are a robot's, and may say anything. */

export interface SoundPacket {
  codec: "opus" | "pcm-s16";
  rate: number;
  channels: number;
  data: Uint8Array;
  /** The capture of its first sample; 0 if it does not say. */
  stampMs: number;
}

const MOST_BYTES = 256 * 1024;
/** Rates that every AudioContext can have. */
const LOWEST = 8000;
const HIGHEST = 96_000;

const stampOf = (value: unknown) => {
  const { sec, nanosec } = (value ?? {}) as { sec?: number; nanosec?: number };
  return (Number(sec) || 0) * 1000 + (Number(nanosec) || 0) / 1e6;
};

/** A RawAudio or AudioPacket as a packet; what is wrong with it, in words, where something is. */
export function packetOf(message: Record<string, unknown>): SoundPacket | string {
  const raw = "format" in message;
  const codec = String(raw ? message.format : message.codec);
  const rate = Number(message.sample_rate);
  const channels = Number(raw ? message.number_of_channels : message.channels);
  const data = message.data;
  if (codec !== "opus" && codec !== "pcm-s16") return `the coding “${codec.slice(0, 20)}” is not played here`;
  if (!(rate >= LOWEST && rate <= HIGHEST) || !(channels >= 1 && channels <= (codec === "opus" ? 2 : 8))) return `${rate} samples a second of ${channels} channels are not played here`;
  if (!(data instanceof Uint8Array) || data.length === 0 || data.length > MOST_BYTES) return "a packet has no sound, or too much";
  if (codec === "pcm-s16" && data.length % (2 * channels) !== 0) return "a packet has half a sample";
  return { codec, rate, channels, data, stampMs: stampOf(raw ? message.timestamp : message.stamp) };
}

/** 16-bit samples, interleaved, as floats of one channel. */
export function mixed({ data, channels }: Pick<SoundPacket, "data" | "channels">): Float32Array<ArrayBuffer> {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const made = new Float32Array(data.length / 2 / channels);
  for (let at = 0; at < made.length; at++) {
    let sum = 0;
    for (let channel = 0; channel < channels; channel++) sum += view.getInt16(2 * (at * channels + channel), true);
    made[at] = sum / channels / 32768;
  }
  return made;
}

/** Floats as 16-bit samples, little-endian. */
export function asPcm(samples: Float32Array): ArrayBuffer {
  const made = new DataView(new ArrayBuffer(2 * samples.length));
  samples.forEach((value, at) => made.setInt16(2 * at, Math.max(-32768, Math.min(32767, Math.round(value * 32768))), true));
  return made.buffer;
}
