/**
 * The stream's binary frames: records of a 40-byte little-endian header, a payload, and padding to 8 bytes.
 *
 * u32 record_bytes | u32 subscription | u32 channel | u32 payload_bytes | u64 seq | i64 stamp_ns | i64 receive_ns
 */

export const HEADER_BYTES = 40;

export interface StreamRecord {
  subscription: number;
  channel: number;
  seq: number;
  stampMs: number;
  receiveMs: number;
  /** A view into the frame; copy it before it leaves this turn of the event loop. */
  payload: Uint8Array<ArrayBuffer>;
}

export class FrameError extends Error {}

const nsToMs = (ns: bigint) => Number(ns / 1000n) / 1000;

/** Split a frame into its records; a frame that contradicts itself is a FrameError. */
export function parseFrame(frame: ArrayBuffer): StreamRecord[] {
  const view = new DataView(frame);
  const records: StreamRecord[] = [];
  let offset = 0;
  while (offset < frame.byteLength) {
    if (frame.byteLength - offset < HEADER_BYTES) throw new FrameError("a record's header is cut off");
    const recordBytes = view.getUint32(offset, true);
    const payloadBytes = view.getUint32(offset + 12, true);
    if (recordBytes % 8 !== 0 || recordBytes < HEADER_BYTES + payloadBytes) throw new FrameError("a record's sizes disagree");
    if (offset + recordBytes > frame.byteLength) throw new FrameError("a record is cut off");
    records.push({
      subscription: view.getUint32(offset + 4, true),
      channel: view.getUint32(offset + 8, true),
      seq: Number(view.getBigUint64(offset + 16, true)),
      stampMs: nsToMs(view.getBigInt64(offset + 24, true)),
      receiveMs: nsToMs(view.getBigInt64(offset + 32, true)),
      payload: new Uint8Array(frame, offset + HEADER_BYTES, payloadBytes),
    });
    offset += recordBytes;
  }
  return records;
}
