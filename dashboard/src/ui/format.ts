/** Numbers and names as people read them. A missing value is an en dash, never a zero. */

export const NONE = "–";

type Maybe = number | null | undefined;
const missing = (value: Maybe): value is null | undefined => value == null || !Number.isFinite(value);

export function fixed(value: Maybe, digits: number, unit = ""): string {
  if (missing(value)) return NONE;
  const text = value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1"); // what rounds to nothing has no sign
  return text + (unit && `\u202f${unit}`);
}

export const percent = (fraction: Maybe) => (missing(fraction) ? NONE : `${Math.round(fraction * 100)}\u202f%`);

const BYTE_UNITS = ["B", "kB", "MB", "GB", "TB"];

export function bytes(count: Maybe): string {
  if (missing(count)) return NONE;
  let value = count;
  let unit = 0;
  while (value >= 999.5 && unit < BYTE_UNITS.length - 1) {
    value /= 1000;
    unit += 1;
  }
  return `${value.toFixed(unit === 0 || value >= 99.5 ? 0 : 1)}\u202f${BYTE_UNITS[unit]}`;
}

export const bytesPerSecond = (count: Maybe) => (missing(count) ? NONE : `${bytes(count)}/s`);

export const integer = (count: Maybe) => (missing(count) ? NONE : Math.round(count).toLocaleString("en"));

/** A number with about three significant digits, for axes and trees. */
export function short(value: Maybe): string {
  if (missing(value)) return NONE;
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-3)) return value.toExponential(2);
  return String(Number(value.toPrecision(4)));
}

/** "8 s", "3 min", "2.5 h", "4 d", "10 years": a span at a glance. */
export function duration(seconds: number): string {
  if (seconds < 10) return `${Number(seconds.toFixed(1))}\u202fs`;
  if (seconds < 100) return `${Math.round(seconds)}\u202fs`;
  if (seconds < 6000) return `${Math.round(seconds / 60)}\u202fmin`;
  if (seconds < 172800) return `${Number((seconds / 3600).toFixed(1))}\u202fh`;
  return seconds < 63e6 ? `${Math.round(seconds / 86400)}\u202fd` : `${Math.round(seconds / 31557600)}\u202fyears`;
}

const CLOCK = new Intl.DateTimeFormat("en-GB", { hour: "2-digit", minute: "2-digit", second: "2-digit" });
const DAY = new Intl.DateTimeFormat("en-GB", { day: "numeric", month: "short" });
const ZONE = new Intl.DateTimeFormat("en-GB", { timeZoneName: "short" });

/** "14:03:11" in the reader's time zone. */
export const clockTime = (ms: number) => CLOCK.format(ms);
/** "21 Nov". */
export const dayText = (ms: number) => DAY.format(ms);
/** "UTC" or "CET": the reader's time zone. */
export const zoneName = (ms: number) => ZONE.formatToParts(ms).find(({ type }) => type === "timeZoneName")?.value ?? "";

/** The topic as the robot itself would say it: without the robot's own namespace. */
export function relativeTopic(topic: string, namespace: string): string {
  const prefix = namespace.endsWith("/") ? namespace : `${namespace}/`;
  return prefix !== "/" && topic.startsWith(prefix) ? topic.slice(prefix.length) : topic;
}

/** "sensor_msgs/msg/Imu" is "Imu" to a reader. */
export const typeWord = (type: string) => type.slice(type.lastIndexOf("/") + 1);
