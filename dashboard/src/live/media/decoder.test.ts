import { expect, test } from "vitest";
import type { Channel } from "../../api/types";
import { Decoder, type Answer, type Order } from "./decoder";
import type { StreamRecord } from "../records";

class FakeWorker {
  onmessage: ((event: MessageEvent) => void) | null = null;
  orders: Order[] = [];

  postMessage(order: Order): void {
    this.orders.push(order);
  }

  decodes() {
    return this.orders.filter((order) => order.kind === "decode");
  }

  answer(answer: Answer): void {
    this.onmessage?.({ data: answer } as MessageEvent);
  }
}

const channel = { type: "std_msgs/msg/String", type_hash: "RIHS01_0", schema: "string data" } as Channel;
const record = (seq: number): StreamRecord => ({ subscription: 1, channel: 1, seq, stampMs: seq, receiveMs: seq, payload: new Uint8Array([seq]) });

function setup(depth: number, chained = false) {
  const worker = new FakeWorker();
  const seen: unknown[] = [];
  const feed = new Decoder(worker).feed({ depth, chained, image: false }, ({ seq, message, error }) => seen.push([seq, message ?? error]));
  return { worker, seen, feed };
}

test("the schema goes once, before the first message", () => {
  const { worker, feed } = setup(4);
  feed.push(channel, record(1));
  worker.answer({ ticket: 1, message: {} });
  feed.push(channel, record(2));
  expect(worker.orders.map(({ kind }) => kind)).toEqual(["schema", "decode", "decode"]);
});

test("while one is decoded only the newest waits in a feed of depth one", () => {
  const { worker, seen, feed } = setup(1);
  for (let seq = 1; seq <= 5; seq++) feed.push(channel, record(seq));
  expect(worker.decodes()).toHaveLength(1);
  worker.answer({ ticket: 1, message: { data: "a" } });
  worker.answer({ ticket: 2, message: { data: "e" } });
  expect(seen).toEqual([[1, { data: "a" }], [5, { data: "e" }]]);
  expect(feed.dropped).toBe(3);
});

test("a deeper feed keeps order and drops the oldest waiting", () => {
  const { worker, seen, feed } = setup(2);
  for (let seq = 1; seq <= 4; seq++) feed.push(channel, record(seq));
  for (let ticket = 1; ticket <= 3; ticket++) worker.answer({ ticket, message: {} });
  expect(seen).toEqual([[1, {}], [3, {}], [4, {}]]);
});

test("where messages build on each other, none that waits is kept when one does not fit", () => {
  const { worker, seen, feed } = setup(2, true);
  for (let seq = 1; seq <= 5; seq++) feed.push(channel, record(seq));
  for (let ticket = 1; ticket <= 2; ticket++) worker.answer({ ticket, message: {} });
  expect(seen).toEqual([[1, {}], [5, {}]]);
  expect(feed.dropped).toBe(3);
});

test("an error is handed on and the feed goes on", () => {
  const { worker, seen, feed } = setup(1);
  feed.push(channel, record(1));
  worker.answer({ ticket: 1, error: "cut off" });
  feed.push(channel, record(2));
  worker.answer({ ticket: 2, message: {} });
  expect(seen).toEqual([[1, "cut off"], [2, {}]]);
});

test("a closed feed says nothing more", () => {
  const { worker, seen, feed } = setup(1);
  feed.push(channel, record(1));
  feed.close();
  worker.answer({ ticket: 1, message: {} });
  expect(seen).toEqual([]);
});
