/** The snapshot of an instant as the gateway sends it: u32 length of a JSON head, the head, then one frame of the stream's records. */

import type { AtHeader, StoredMessage } from "../api/history_types";
import type { Channel } from "../api/types";
import { FrameError, parseFrame, type StreamRecord } from "../live/records";

export interface Snapshot {
  header: AtHeader;
  /** By topic: what a topic is, and its sample, of those that have one. */
  channels: Map<string, Channel>;
  records: Map<string, StreamRecord>;
}

export function parseSnapshot(body: ArrayBuffer): Snapshot {
  if (body.byteLength < 4) throw new FrameError("the answer has no head");
  const size = new DataView(body).getUint32(0, true);
  if (4 + size > body.byteLength) throw new FrameError("the answer's head is cut off");
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(body, 4, size))) as AtHeader;
  const byNumber = new Map(header.channels.map((channel) => [channel.channel, channel]));
  const records = new Map<string, StreamRecord>();
  for (const record of parseFrame(body.slice(4 + size))) {
    const channel = byNumber.get(record.channel);
    if (channel) records.set(channel.topic, record);
  }
  return { header, channels: new Map(header.channels.map((channel) => [channel.topic, channel])), records };
}

/** A stored message as the record that the stream would have sent. */
export function recordOf(message: StoredMessage, channel: number): StreamRecord {
  const payload = Uint8Array.from(atob(message.cdr), (letter) => letter.charCodeAt(0));
  const { seq, stamp_ms: stampMs } = message;
  return { subscription: 0, channel, seq, stampMs, receiveMs: stampMs, payload };
}
