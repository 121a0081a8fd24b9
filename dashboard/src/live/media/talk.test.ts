import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { ACK_LIMIT_MS, IDLE_RELEASE_MS, Talk, type TalkSocket } from "./talk";

const WORD = new ArrayBuffer(4);

class FakeTalkSocket implements TalkSocket {
  onopen: TalkSocket["onopen"] = null;
  onclose: TalkSocket["onclose"] = null;
  onmessage: TalkSocket["onmessage"] = null;
  sent: unknown[] = [];
  closed = false;
  send(data: string | ArrayBuffer): void {
    this.sent.push(typeof data === "string" ? (JSON.parse(data) as { op: string }).op : data);
  }
  close(): void {
    this.closed = true;
  }
  say(message: object): void {
    this.onmessage?.({ data: JSON.stringify(message) } as MessageEvent);
  }
}

let socket: FakeTalkSocket;
let speak: (data: ArrayBuffer) => void;
let open: number;
let denied: Error | null;
let talk: Talk;

beforeEach(() => {
  vi.useFakeTimers();
  [open, denied] = [0, null];
  talk = new Talk(
    {
      connect: () => (socket = new FakeTalkSocket()),
      coding: () => Promise.resolve({ codec: "opus", rate: 48000 }),
      open: (_coding, onPacket) => {
        if (denied) return Promise.reject(denied);
        open += 1;
        speak = onPacket;
        return Promise.resolve({ close: () => (open -= 1) });
      },
    },
    "ann",
    () => Date.now(),
  );
});
afterEach(() => vi.useRealTimers());

async function asked(): Promise<void> {
  talk.hold();
  await vi.advanceTimersByTimeAsync(0);
  socket.onopen?.({} as Event);
}

async function talking(): Promise<void> {
  await asked();
  socket.say({ op: "granted" });
}

test("sound goes out only under the lease and while it is held", async () => {
  await asked();
  speak(WORD);
  expect(socket.sent).toEqual(["take"]);
  socket.say({ op: "granted" });
  expect(talk.state.value).toBe("talking");
  speak(WORD);
  talk.letGo();
  speak(WORD);
  expect(socket.sent).toEqual(["take", WORD, "stop"]);
  expect(talk.state.value).toBe("armed");
  talk.hold();
  speak(WORD);
  expect(socket.sent).toEqual(["take", WORD, "stop", WORD]);
});

test("letting go before the microphone is open says nothing", async () => {
  talk.hold();
  talk.letGo();
  await vi.advanceTimersByTimeAsync(0);
  socket.onopen?.({} as Event);
  socket.say({ op: "granted" });
  speak(WORD);
  expect(socket.sent).toEqual(["take"]);
  await vi.advanceTimersByTimeAsync(IDLE_RELEASE_MS);
  expect([open, socket.closed, talk.state.value]).toEqual([0, true, "idle"]);
});

test("pressing again while the microphone opens opens no second one", async () => {
  talk.hold();
  talk.letGo();
  talk.hold();
  await vi.advanceTimersByTimeAsync(0);
  socket.onopen?.({} as Event);
  expect([open, socket.sent]).toEqual([1, ["take"]]);
  talk.release();
  expect([open, socket.closed]).toEqual([0, true]);
});

test("after a while lease and microphone are given back", async () => {
  await talking();
  talk.letGo();
  await vi.advanceTimersByTimeAsync(IDLE_RELEASE_MS);
  expect(socket.sent.at(-1)).toBe("release");
  expect([open, socket.closed]).toEqual([0, true]);
});

test("who talks already is named", async () => {
  await asked();
  socket.say({ op: "refused", code: "lease_taken", message: "no", holder: "bob" });
  expect([talk.state.value, talk.detail.value, open]).toEqual(["refused", "bob is talking", 0]);
});

test("a person who says no to the microphone", async () => {
  denied = new Error("Permission denied");
  talk.hold();
  await vi.advanceTimersByTimeAsync(0);
  expect([talk.state.value, talk.detail.value]).toEqual(["refused", "Permission denied"]);
});

test("without acknowledgements, or without the link, it is over", async () => {
  await talking();
  await vi.advanceTimersByTimeAsync(ACK_LIMIT_MS + 1);
  speak(WORD);
  expect([talk.state.value, open]).toEqual(["lost", 0]);
  await talking();
  socket.onclose?.({} as CloseEvent);
  expect([talk.state.value, open]).toEqual(["lost", 0]);
});

test("all given back while the microphone still opens", async () => {
  talk.hold();
  talk.release();
  await vi.advanceTimersByTimeAsync(0);
  expect([talk.state.value, open]).toEqual(["idle", 0]);
});
