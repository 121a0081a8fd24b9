/** Off the main thread: CDR to objects by the channel's own schema, and pictures to bitmaps. */

import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { Keyring, SealError } from "../../seal/envelope";
import { CloudReader } from "./cloud";
import type { Answer, Order } from "./decoder";
import { rawToRgba, type RawImage } from "./raw_image";

/** Of a cloud: what a page draws smoothly, also where a graphics card is missing. */
const CLOUD_BUDGET = { points: 200_000, ms: 30 };

const readers = new Map<string, MessageReader>();
const clouds = new CloudReader(CLOUD_BUDGET);
let keyring: Promise<Keyring> | null = null;
const post = (answer: Answer, transfer: Transferable[] = []) => self.postMessage(answer, { transfer });

async function toBitmap(message: Record<string, unknown>): Promise<ImageBitmap> {
  if (typeof message.format === "string") {
    return createImageBitmap(new Blob([message.data as Uint8Array<ArrayBuffer>]));
  }
  const image = message as unknown as RawImage;
  return createImageBitmap(new ImageData(rawToRgba(image), image.width, image.height));
}

/** When a picture was taken, by its header. */
function takenMs({ header }: Record<string, unknown>): number {
  const { sec, nanosec } = (header as { stamp: { sec: number; nanosec: number } }).stamp;
  return sec * 1000 + nanosec / 1e6;
}

async function opened({ payload, sealed }: Extract<Order, { kind: "decode" }>): Promise<ArrayBuffer> {
  if (!sealed) return payload;
  if (!keyring) throw new SealError("sealed: open it with its keyring, above");
  return (await keyring).open(new Uint8Array(payload), sealed.origin, sealed.seq);
}

async function decode(order: Extract<Order, { kind: "decode" }>): Promise<void> {
  const reader = readers.get(order.key);
  if (!reader) throw new Error("no schema");
  const message = reader.readMessage<Record<string, unknown>>(new Uint8Array(await opened(order)));
  if (order.cloud) {
    const cloud = clouds.read(message);
    post({ ticket: order.ticket, cloud }, cloud.intensities ? [cloud.positions.buffer, cloud.intensities.buffer] : [cloud.positions.buffer]);
    return;
  }
  if (!order.image) {
    post({ ticket: order.ticket, message });
    return;
  }
  const bitmap = await toBitmap(message);
  post({ ticket: order.ticket, bitmap, takenMs: takenMs(message) }, [bitmap]);
}

self.onmessage = (event: MessageEvent<Order>) => {
  const order = event.data;
  if (order.kind === "keyring") {
    keyring = Keyring.parse(order.text);
    return;
  }
  if (order.kind === "schema") {
    try {
      readers.set(order.key, new MessageReader(parse(order.schema, { ros2: true })));
    } catch (error) {
      console.warn(`schema of ${order.key}: ${String(error)}`);
    }
    return;
  }
  decode(order).catch((error: unknown) => {
    post({ ticket: order.ticket, error: error instanceof Error ? error.message : String(error) });
  });
};
