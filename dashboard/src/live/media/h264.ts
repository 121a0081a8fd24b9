/** What a page must know of an H.264 access unit in Annex B (ITU-T H.264, 7.3.1 and Annex B): where decoding can begin, and with what. */

/** NAL unit types of table 7-1. */
const SLICE = 1;
const KEY_SLICE = 5;
const PARAMETERS = 7;

export interface AccessUnit {
  /** Decoding can begin here: it has an IDR slice. */
  key: boolean;
  /** The sequence parameter set in front of it, as the decoder wants to be told of it: "avc1.42c01f"; null without one. */
  codec: string | null;
  /** That set's bytes in hexadecimal: another one may be another size. */
  parameters: string;
}

const hex = (bytes: Uint8Array) => Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");

/** Look at the units up to the first slice; what is no H.264 has no slice and is no key. */
export function inspect(data: Uint8Array): AccessUnit {
  const found: AccessUnit = { key: false, codec: null, parameters: "" };
  let at = nextUnit(data, 0);
  while (at < data.length) {
    const type = data[at]! & 0x1f;
    if (type === SLICE || type === KEY_SLICE) {
      found.key = type === KEY_SLICE;
      return found;
    }
    const next = nextUnit(data, at);
    if (type === PARAMETERS && at + 4 <= data.length) {
      const end = next < data.length ? next - 3 : data.length;
      found.codec = `avc1.${hex(data.subarray(at + 1, at + 4))}`;
      found.parameters = hex(data.subarray(at, Math.min(end, at + 256)));
    }
    at = next;
  }
  return found;
}

/** The index behind the next start code 00 00 01, or the data's length. */
function nextUnit(data: Uint8Array, from: number): number {
  for (let at = from; at + 2 < data.length; at++) {
    if (data[at] === 0 && data[at + 1] === 0 && data[at + 2] === 1) return at + 3;
  }
  return data.length;
}
