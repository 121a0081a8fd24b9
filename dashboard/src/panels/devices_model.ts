/** Devices by their diagnostics (diagnostic_msgs/DiagnosticArray): of our drivers, and of any other ROS node. */

/** Worst first. `silent` is the page's own word: it said nothing for long. */
export const STATES = ["failed", "error", "waiting", "silent", "stale", "warning", "opening", "working", "ok", "resting"] as const;
export type DeviceState = (typeof STATES)[number];

export interface Value {
  key: string;
  text: string;
  /** A count that rose lately. */
  rising: boolean;
}

export interface Device {
  name: string;
  /** Which driver it is; "" of a foreign node. */
  kind: string;
  state: DeviceState;
  message: string;
  hardwareId: string;
  rateHz: number | null;
  /** The latest rates, oldest first. */
  rates: number[];
  values: Value[];
  seenMs: number;
}

interface Status {
  level: number;
  name: string;
  message: string;
  hardware_id: string;
  values: { key: string; value: string }[];
}

export const MAX_DEVICES = 100;
const MAX_VALUES = 80;
const MAX_TEXT = 240;
const RATES = 40;
/** So long a count that rose is marked. */
const RISING_MS = 10_000;
/** By level where the driver does not say its state: OK, WARN, ERROR, STALE. */
const LEVELS: DeviceState[] = ["ok", "warning", "error", "stale"];
const SAID = new Set<string>(["failed", "waiting", "stale", "opening", "working", "resting"]);
const OWN_KEYS = new Set(["kind", "state", "rate_hz"]);
const TROUBLE = /bad|error|lost|drop|garb|refus|reject|overrun|overflow|timeout|invalid|checksum|crc|short|resync|skipped/;

/** Whether a count that rises is no good sign. */
export const isTrouble = (key: string) => TROUBLE.test(key);
const cut = (text: string) => (text.length > MAX_TEXT ? `${text.slice(0, MAX_TEXT)}…` : text);

export class DevicesModel {
  /** Devices beyond the table's bound that were left out. */
  readonly refused = new Set<string>();
  #devices = new Map<string, Device>();
  #rose = new Map<string, number>();

  add(message: object, seenMs: number): void {
    for (const status of (message as { status: Status[] }).status) this.#take(status, seenMs);
  }

  clear(): void {
    this.#devices.clear();
    this.#rose.clear();
    this.refused.clear();
  }

  /** Worst first; who said nothing for longer than `silentMs` is silent. */
  rows(atMs: number, silentMs: number): Device[] {
    const rows = [...this.#devices.values()].map((device) =>
      atMs - device.seenMs > silentMs ? { ...device, state: "silent" as const } : device,
    );
    return rows.sort((a, b) => STATES.indexOf(a.state) - STATES.indexOf(b.state) || a.name.localeCompare(b.name));
  }

  #take(status: Status, seenMs: number): void {
    const before = this.#devices.get(status.name);
    if (!before && this.#devices.size >= MAX_DEVICES) {
      if (this.refused.size < MAX_DEVICES) this.refused.add(status.name);
      return;
    }
    const said = new Map(status.values.slice(0, MAX_VALUES).map(({ key, value }) => [key, value]));
    const own = said.has("kind") && SAID.has(said.get("state") ?? "");
    const rateHz = said.has("rate_hz") ? Number(said.get("rate_hz")) : null;
    const state = own ? (said.get("state") as DeviceState) : (LEVELS[status.level] ?? "error");
    this.#devices.set(status.name, {
      name: cut(status.name),
      kind: cut(said.get("kind") ?? ""),
      state: own && state === "working" && status.level === 1 ? "warning" : state,
      message: cut(status.message),
      hardwareId: cut(status.hardware_id),
      rateHz: Number.isFinite(rateHz) ? rateHz : null,
      rates: rateHz !== null && Number.isFinite(rateHz) ? [...(before?.rates ?? []), rateHz].slice(-RATES) : [],
      values: [...said].filter(([key]) => !own || !OWN_KEYS.has(key)).map(([key, text]) => this.#value(status.name, key, text, before, seenMs)),
      seenMs,
    });
  }

  #value(name: string, key: string, text: string, before: Device | undefined, seenMs: number): Value {
    const place = `${name}\n${key}`;
    const last = before?.values.find((value) => value.key === key)?.text;
    if (/^\d+$/.test(text) && last !== undefined && Number(text) > Number(last)) this.#rose.set(place, seenMs);
    const roseMs = this.#rose.get(place);
    const rising = roseMs !== undefined && seenMs - roseMs < RISING_MS;
    if (!rising) this.#rose.delete(place);
    return { key: cut(key), text: cut(text), rising };
  }
}
