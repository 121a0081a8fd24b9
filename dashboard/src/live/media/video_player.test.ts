import { beforeEach, expect, test } from "vitest";
import { KEY_WAIT_MS, MAX_WAITING, VideoPlayer, type Codecs } from "./video_player";

const unit = (...bytes: number[]) => [0, 0, 0, 1, ...bytes];
const key = (level = 0x1f) => new Uint8Array([...unit(0x67, 0x42, 0xc0, level), ...unit(0x68, 1), ...unit(0x65, 1)]);
const delta = () => new Uint8Array(unit(0x41, 1));

class FakeDecoder {
  static made: FakeDecoder[] = [];
  state = "unconfigured" as CodecState;
  decodeQueueSize = 0;
  codecs: string[] = [];
  kinds: string[] = [];

  constructor(readonly init: VideoDecoderInit) {
    FakeDecoder.made.push(this);
  }

  configure({ codec }: VideoDecoderConfig): void {
    this.state = "configured";
    this.codecs.push(codec);
  }

  decode(chunk: EncodedVideoChunk): void {
    this.kinds.push(chunk.type);
  }

  close(): void {
    this.state = "closed";
  }

  fail(): void {
    this.state = "closed";
    this.init.error(new DOMException("broken"));
  }

  show(timestamp: number): { closed: boolean } {
    const frame = { timestamp, closed: false, close: () => void (frame.closed = true) };
    this.init.output(frame as unknown as VideoFrame);
    return frame;
  }
}

const codecs = { decoder: (init: VideoDecoderInit) => new FakeDecoder(init), chunk: (init: unknown) => init } as unknown as Codecs;
let nowMs: number;
let asks: number;
let problem: string;
let shown: number[];
let player: VideoPlayer;
let seq: number;

beforeEach(() => {
  FakeDecoder.made = [];
  [nowMs, asks, problem, shown, seq] = [1000, 0, "", [], 0];
  const events = {
    onFrame: (_: VideoFrame, takenMs: number) => void shown.push(takenMs),
    onAsk: () => void (asks += 1),
    onProblem: (words: string) => void (problem = words),
  };
  player = new VideoPlayer(events, codecs, () => nowMs);
});

function push(...units: Uint8Array<ArrayBuffer>[]): void {
  for (const data of units) player.push({ data, takenMs: 1_700_000_000_000.25, seq: ++seq });
}

const made = () => FakeDecoder.made.at(-1)!;

test("it begins at a key frame and gives frames their own stamp", () => {
  push(delta(), delta(), key(), delta());
  expect(made().codecs).toEqual(["avc1.42c01f"]);
  expect(made().kinds).toEqual(["key", "delta"]);
  made().show(1_700_000_000_000_250);
  expect(shown).toEqual([1_700_000_000_000.25]);
});

test("the same parameters configure once, others anew", () => {
  push(key(), delta(), key(), key(0x28));
  expect(FakeDecoder.made).toHaveLength(1);
  expect(made().codecs).toEqual(["avc1.42c01f", "avc1.42c028"]);
});

test("after a missing chunk nothing is decoded until a key frame, which is asked for now and then", () => {
  push(key(), delta());
  seq += 1;
  push(delta(), delta());
  expect(made().kinds).toEqual(["key", "delta"]);
  expect(asks).toBe(1);
  seq += 1;
  push(delta());
  expect(asks).toBe(1);
  nowMs += KEY_WAIT_MS + 1;
  push(delta());
  expect(asks).toBe(2);
  push(key(), delta());
  expect(made().kinds.slice(-2)).toEqual(["key", "delta"]);
});

test("a gateway that goes on with a key frame is not asked for another", () => {
  push(key(), delta());
  seq += 5;
  push(key(), delta());
  expect(made().kinds).toEqual(["key", "delta", "key", "delta"]);
  expect(asks).toBe(0);
});

test("a decoder that is behind is dropped with what waits in it", () => {
  push(key(), delta());
  const slow = made();
  slow.decodeQueueSize = MAX_WAITING;
  push(delta(), delta());
  expect(slow.state).toBe("closed");
  expect(player.skipped).toBe(1);
  push(key());
  expect(made()).not.toBe(slow);
  expect(slow.show(1).closed).toBe(true);
  expect(shown).toEqual([]);
});

test("a failure asks for a key frame, and is told when it comes again and again", () => {
  for (let i = 0; i < 3; i++) {
    push(key());
    made().fail();
    expect(player.waits).toBe(true);
    nowMs += KEY_WAIT_MS;
  }
  expect(asks).toBe(3);
  expect(problem).toContain("broken");
  push(key());
  made().show(1);
  expect(problem).toBe("");
});

test("a restart forgets the stream before", () => {
  push(key(), delta());
  const before = made();
  player.restart();
  expect(before.state).toBe("closed");
  push(delta(), key());
  expect(made().kinds).toEqual(["key"]);
});
