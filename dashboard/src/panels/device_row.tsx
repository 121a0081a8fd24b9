/** One device: what it is, its status, its rate; what it counts when unfolded. */

import { ageText } from "../live/age";
import { relativeTopic, short } from "../ui/format";
import { Spark } from "../ui/parts";
import { isTrouble, type Device, type DeviceState, type Value } from "./devices_model";

/** Icons of 16 by 16, drawn by strokes. */
const ICONS = {
  eye: "M1.5 5.5h3l1.2-2h4.6l1.2 2h3v8h-13Zm6.5 1.6a2.3 2.3 0 1 0 0 4.6 2.3 2.3 0 0 0 0-4.6Z",
  range: "M8 12.5h.01M5.2 9.7a4 4 0 0 1 5.6 0M2.9 7.2a7.2 7.2 0 0 1 10.2 0M1 4.6a10 10 0 0 1 14 0",
  microphone: "M8 1.5a2 2 0 0 0-2 2v4a2 2 0 0 0 4 0v-4a2 2 0 0 0-2-2ZM3.5 7.5a4.5 4.5 0 0 0 9 0M8 12v2.5M5.5 14.5h5",
  speaker: "M2 6v4h2.5L8 13V3L4.5 6ZM10.5 5.5a3.5 3.5 0 0 1 0 5M12.5 3.5a6.4 6.4 0 0 1 0 9",
  place: "M8 14.5s4.7-4.4 4.7-8A4.7 4.7 0 0 0 8 1.7a4.7 4.7 0 0 0-4.7 4.8c0 3.6 4.7 8 4.7 8ZM8 4.8a1.7 1.7 0 1 0 0 3.4 1.7 1.7 0 0 0 0-3.4Z",
  axes: "M8 9V1.5M8 9l6 4M8 9l-6 4M6.3 3.2 8 1.5l1.7 1.7",
  pad: "M4.5 4.5h7a3 3 0 0 1 3 3.3l-.4 3a1.9 1.9 0 0 1-3.4.9L9.5 10h-3l-1.2 1.7a1.9 1.9 0 0 1-3.4-.9l-.4-3a3 3 0 0 1 3-3.3ZM5.5 6v2.5M4.2 7.2h2.6M10.8 7.2h.01",
  wheels: "M2.5 4.5h11v5h-11ZM4.6 9.5a2 2 0 1 0 0 4 2 2 0 0 0 0-4ZM11.4 9.5a2 2 0 1 0 0 4 2 2 0 0 0 0-4Z",
  wing: "M8 2v9M1.5 8.2 8 6.5l6.5 1.7M5.5 13 8 11.6l2.5 1.4",
  wire: "M5.5 1.5v3M10.5 1.5v3M3.5 4.5h9V8a4.5 4.5 0 0 1-9 0ZM8 12.5v2",
  host: "M2 3h12v7.5H2ZM5.5 13.5h5M8 10.5v3",
  chip: "M4.5 4.5h7v7h-7ZM6.5 1.8v2.7M9.5 1.8v2.7M6.5 11.5v2.7M9.5 11.5v2.7M1.8 6.5h2.7M1.8 9.5h2.7M11.5 6.5h2.7M11.5 9.5h2.7",
};

/** By words within the kind, so that a new driver of a known sort has its icon. */
const ICON_OF: [RegExp, keyof typeof ICONS][] = [
  [/camera/, "eye"], [/lidar|^ld|vlp|range|sonar/, "range"], [/micro/, "microphone"], [/speaker|sound/, "speaker"], [/gps|gnss/, "place"],
  [/imu/, "axes"], [/joy|pad/, "pad"], [/base|drive|wheel/, "wheels"], [/mavlink|vehicle/, "wing"], [/can|modbus|serial|gpio|sensor/, "wire"], [/host/, "host"],
];

const TONES: Record<DeviceState, "good" | "quiet" | "warn" | "bad"> = {
  failed: "bad", error: "bad", waiting: "bad", silent: "warn", stale: "warn", warning: "warn", opening: "warn", working: "good", ok: "good", resting: "quiet",
};
/** A shape for each tone, as colour alone says nothing to some. */
const SHAPES = {
  good: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z",
  quiet: "M6 1.5a4.5 4.5 0 1 1 0 9 4.5 4.5 0 0 1 0-9Zm0 2a2.5 2.5 0 1 0 0 5 2.5 2.5 0 0 0 0-5Z",
  warn: "M6 .8 11.6 11H.4Z",
  bad: "M1.5 1.5h9v9h-9Zm2 2v5h5v-5Z",
};

/** What is younger is current. */
const CURRENT_MS = 3000;

export function DeviceRow({ device, namespace, atMs }: { device: Device; namespace: string; atMs: number }) {
  const { name, kind, state, message, hardwareId, rateHz, rates, values, seenMs } = device;
  const silent = state === "silent";
  const ageMs = atMs - seenMs;
  const runs = !silent && rateHz !== null && rateHz > 0;
  const troubles = values.filter(({ key, rising }) => rising && isTrouble(key));
  const title = relativeTopic(name, namespace);
  const said = silent ? `said nothing for ${ageText(ageMs)}; then: ${message}` : message === state ? "" : message;
  return (
    <details class={`device device-${TONES[state]}`} data-device={name} data-state={state}>
      <summary>
        <svg class="device-icon" viewBox="0 0 16 16" aria-hidden="true"><path d={ICONS[iconOf(kind)]} /></svg>
        <span class="device-name">
          <b>{title}</b>
          {kind && kind !== title && <small>{kind}</small>}
        </span>
        <span class={`device-state device-tone-${TONES[state]}`}>
          <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[TONES[state]]} fill-rule="evenodd" /></svg>
          {state}
        </span>
        <span class="device-said">
          {said}
          {troubles.map(({ key, text }) => <span key={key} class="device-trouble">{key.replaceAll("_", " ")} {text} ↑</span>)}
        </span>
        <span class="device-rate num">
          {runs && <Spark values={rates} top={1.25 * Math.max(...rates)} />}
          {runs && <span class="device-hertz">{short(rateHz)}{"\u202f"}Hz</span>}
          {ageMs > CURRENT_MS && !silent && <span class="age">{ageText(ageMs)} old</span>}
        </span>
      </summary>
      <Details name={name} hardwareId={hardwareId} values={values} />
    </details>
  );
}

function Details({ name, hardwareId, values }: { name: string; hardwareId: string; values: Value[] }) {
  return (
    <dl class="device-values">
      <div><dt>node</dt><dd class="mono">{name}</dd></div>
      {hardwareId && <div><dt>hardware</dt><dd class="mono">{hardwareId}</dd></div>}
      {values.map(({ key, text, rising }) => (
        <div key={key} class={rising && isTrouble(key) ? "rising" : undefined}>
          <dt>{key.replaceAll("_", " ")}</dt>
          <dd class="mono">{text}{rising && <span aria-label="rising"> ↑</span>}</dd>
        </div>
      ))}
    </dl>
  );
}

const iconOf = (kind: string) => ICON_OF.find(([words]) => words.test(kind))?.[1] ?? "chip";
