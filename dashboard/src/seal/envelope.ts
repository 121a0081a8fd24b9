/**
 * Opens sealed payloads with WebCrypto. The layout is that of metaros/seal/envelope.py:
 *
 * version 1 | key id 8 | nonce 12 | boot 16 | stream 4 | epoch 8 | seq 8 | ciphertext and tag, big-endian
 */

export { SEALED_CDR } from "./encoding";
export const HEAD_BYTES = 57;
const OVERHEAD_BYTES = HEAD_BYTES + 16;
const MOST_KEYS = 256;
const KEYRING_BYTES = 64 * 1024;

/** Whose payload it is, as the stream introduced its channel. */
export interface Origin {
  robot: string;
  topic: string;
  type: string;
  type_hash: string;
}

export class SealError extends Error {}

const utf8 = new TextEncoder();
const hex = (bytes: Uint8Array) => Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");

function joined(...parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(parts.reduce((size, part) => size + part.length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

function withLength(text: string): Uint8Array {
  const bytes = utf8.encode(text);
  const length = new Uint8Array(4);
  new DataView(length.buffer).setUint32(0, bytes.length);
  return joined(length, bytes);
}

/** Keys that cannot be read out again; they live in this page alone, until it is closed. */
export class Keyring {
  #data = new Map<string, Promise<CryptoKey>>();

  private constructor(private readonly secrets: Map<string, CryptoKey>) {}

  /** The ids of its keys. */
  get ids(): string[] {
    return [...this.secrets.keys()];
  }

  /** Read the text of a keyring file; SealError when it is none. */
  static async parse(text: string): Promise<Keyring> {
    if (!globalThis.crypto?.subtle) throw new SealError("browsers open sealed topics over https, or on the gateway's own machine, alone");
    if (text.length > KEYRING_BYTES) throw new SealError("that is no keyring: it is too long");
    const secrets = new Map<string, CryptoKey>();
    try {
      for (const { id, secret } of (JSON.parse(text) as { keys: { id: string; secret: string }[] }).keys) {
        const bytes = Uint8Array.from(atob(secret), (letter) => letter.charCodeAt(0));
        if (!/^[0-9a-f]{16}$/.test(id) || bytes.length !== 32) throw new Error("a key of another length");
        secrets.set(id, await crypto.subtle.importKey("raw", bytes, "HKDF", false, ["deriveKey"]));
      }
    } catch {
      throw new SealError("that is no keyring");
    }
    if (secrets.size === 0) throw new SealError("the keyring is empty");
    return new Keyring(secrets);
  }

  /** The payload; SealError when its key is not here, or it was changed or moved. `seq` is where it was found. */
  async open(sealed: Uint8Array<ArrayBuffer>, origin: Origin, seq: number): Promise<ArrayBuffer> {
    if (sealed.length < OVERHEAD_BYTES || sealed[0] !== 1) throw new SealError("no sealed payload");
    const head = sealed.subarray(0, HEAD_BYTES);
    const view = new DataView(sealed.buffer, sealed.byteOffset);
    if (Number(view.getBigUint64(49)) !== seq) throw new SealError("sealed under another number");
    const codec = `cdr ${origin.type} ${origin.type_hash}`;
    const bound = joined(head, withLength(origin.robot), withLength(origin.topic), withLength(codec));
    const key = await this.#dataKey(head, origin.robot);
    try {
      const how = { name: "AES-GCM", iv: sealed.slice(9, 21), additionalData: bound };
      return await crypto.subtle.decrypt(how, key, sealed.slice(HEAD_BYTES));
    } catch {
      throw new SealError("changed on its way, or not of this robot, topic and type");
    }
  }

  #dataKey(head: Uint8Array, robot: string): Promise<CryptoKey> {
    const id = hex(head.subarray(1, 9));
    const place = `${hex(head.subarray(1, 9))}${hex(head.subarray(21, 41))}${robot}`;
    const known = this.#data.get(place);
    if (known) return known;
    const secret = this.secrets.get(id);
    if (!secret) throw new SealError(`sealed by key ${id}, which is not here: your keyring holds another`);
    const info = joined(utf8.encode("metaros seal 1\0"), head.subarray(1, 9), head.subarray(37, 41), utf8.encode(robot));
    const how = { name: "HKDF", hash: "SHA-256", salt: head.slice(21, 37), info };
    const made = crypto.subtle.deriveKey(how, secret, { name: "AES-GCM", length: 256 }, false, ["decrypt"]);
    this.#data.set(place, made);
    const oldest = this.#data.keys().next().value;
    if (this.#data.size > MOST_KEYS && oldest !== undefined) this.#data.delete(oldest);
    return made;
  }
}
