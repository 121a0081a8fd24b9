import { expect, test } from "vitest";
import { Keyring, SealError, type Origin } from "./envelope";

/** Made by metaros.seal: key id 00…07, secret 00…1f, robot r1, stream 5, epoch 2^63, number 41. */
const SEALED =
  "010001020304050607070707070000000000000000070707070707070707070707070707070000000580000000000000000000000000000029" +
  "d10f0b9dc4cdb39f4b875b9bfcc118e00a1ef0af8ec8";
const ORIGIN: Origin = { robot: "r1", topic: "/caf\u00e9", type: "std_msgs/msg/String", type_hash: "RIHS01_0" };
const SECRET = "AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8=";

const ring = (id = "0001020304050607", secret = SECRET) => Keyring.parse(JSON.stringify({ version: 1, keys: [{ id, secret, created_ns: 0 }] }));
const bytes = () => Uint8Array.from(SEALED.match(/../g)!, (pair) => parseInt(pair, 16));

test("what the robot sealed opens in the browser", async () => {
  const payload = await (await ring()).open(bytes(), ORIGIN, 41);
  expect(new TextDecoder().decode(payload)).toBe("opened");
});

test.each([
  { robot: "r2" },
  { topic: "/other" },
  { type: "std_msgs/msg/Bool" },
  { type_hash: "RIHS01_1" },
])("of another origin it does not: %o", async (changed) => {
  await expect((await ring()).open(bytes(), { ...ORIGIN, ...changed }, 41)).rejects.toThrow(SealError);
});

test.each([40, 42])("under another number it does not: %i", async (seq) => {
  await expect((await ring()).open(bytes(), ORIGIN, seq)).rejects.toThrow("another number");
});

test("with any byte changed it does not", async () => {
  const keys = await ring();
  for (let at = 0; at < bytes().length; at++) {
    const changed = bytes();
    changed[at] = changed[at]! ^ 1;
    await expect(keys.open(changed, ORIGIN, 41)).rejects.toThrow(SealError);
  }
});

test("a key that is not here is named, and another secret opens nothing", async () => {
  await expect((await ring("ffffffffffffffff")).open(bytes(), ORIGIN, 41)).rejects.toThrow("0001020304050607");
  await expect((await ring(undefined, btoa("x".repeat(32)))).open(bytes(), ORIGIN, 41)).rejects.toThrow("changed on its way");
});

test.each(["", "{}", "[]", '{"keys":[]}', '{"keys":[{"id":"00","secret":""}]}', "x".repeat(100_000)])("no keyring: %s", async (text) => {
  await expect(Keyring.parse(text)).rejects.toThrow(SealError);
});
