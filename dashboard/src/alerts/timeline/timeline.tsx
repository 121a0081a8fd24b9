/** Alerts in time: a lane for each robot, a bar for each alert from where it began to where it ended. */

import { useSignal, type Signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import type { Alert } from "../../api/alerts";
import { ticksOf, xOf, type Window } from "../../history/span";
import { clockTime, dayText, duration } from "../../ui/format";
import { Link } from "../../ui/parts";
import { robotHref } from "../../ui/url";
import { lanesOf, type Bar, type Lane } from "./lanes";
import { alertHref } from "../badges";
import { beganMs, endedMs, isOver } from "../words";

const LANES = 10;
/** What ticks are spread for: the least width of the card on a desk. */
const WIDE_PX = 900;
const NARROW_PX = 270;

export function AlertTimeline({ alerts, window: shown, narrow }: { alerts: Alert[]; window: Window; narrow: boolean }) {
  const pointed = useSignal<Alert | null>(null);
  const all = useSignal(false);
  const lanes = useMemo(() => lanesOf(alerts, shown), [alerts, shown.startMs, shown.endMs]);
  const visible = all.value ? lanes : lanes.slice(0, LANES);
  const hours = duration((shown.endMs - shown.startMs) / 1000);
  return (
    <section class="card card-lanes" aria-label="Timeline" data-lanes={lanes.length}>
      <header>
        <h2>The last {hours}</h2>
        <span class="note num" aria-live="off">{pointed.value && barText(pointed.value, true)}</span>
      </header>
      {lanes.length === 0 ? <p class="lanes-none">Nothing happened.</p> : (
        <div class="lanes">
          <ol>
            {visible.map((lane) => <LaneRow key={lane.robot} lane={lane} pointed={pointed} />)}
          </ol>
          <Ticks window={shown} width={narrow ? NARROW_PX : WIDE_PX} />
        </div>
      )}
      {lanes.length > LANES && (
        <p class="lanes-more">
          <button type="button" class="button" onClick={() => (all.value = !all.value)}>
            {all.value ? "Fewer robots" : `${lanes.length - LANES} more robots`}
          </button>
        </p>
      )}
    </section>
  );
}

function LaneRow({ lane, pointed }: { lane: Lane; pointed: Signal<Alert | null> }) {
  return (
    <li data-lane={lane.robot}>
      <Link href={robotHref(lane.robot)} class="lane-name">{lane.robot || "the gateway"}</Link>
      <div class="lane" style={{ blockSize: `${lane.rows * 15 + 9}px` }} onMouseLeave={() => (pointed.value = null)}>
        {lane.bars.map((bar) => <BarLink key={bar.alert.id} bar={bar} pointed={pointed} />)}
      </div>
    </li>
  );
}

function BarLink({ bar: { alert, from, to, row }, pointed }: { bar: Bar; pointed: Signal<Alert | null> }) {
  const point = () => (pointed.value = alert);
  return (
    <span
      class={`lane-bar severity-${alert.severity}`}
      data-bar={alert.id}
      data-over={isOver(alert)}
      data-quiet={alert.quiet}
      data-state={alert.state}
      style={{ insetInlineStart: `min(${100 * from}%, 100% - 7px)`, inlineSize: `${100 * (to - from)}%`, insetBlockStart: `${5 + row * 15}px` }}
      onMouseEnter={point}
      onFocusIn={point}
    >
      <Link href={alertHref(alert.id)} label={barText(alert)} />
    </span>
  );
}

/** "error, Motor hot, sim_1, 13:02:11 to 13:10:40". */
export function barText(alert: Alert, short = false): string {
  const end = endedMs(alert);
  const days = (end ?? Date.now()) - beganMs(alert) > 86_400_000;
  const at = (ms: number) => (days ? `${dayText(ms)} ${clockTime(ms).slice(0, 5)}` : clockTime(ms));
  const span = `${at(beganMs(alert))} – ${end === null ? "goes on" : at(end)}`;
  return short ? `${alert.robot} · ${alert.title} · ${span}` : `${alert.severity}: ${alert.title}, ${alert.robot}, ${span}`;
}

function Ticks({ window: shown, width }: { window: Window; width: number }) {
  const days = shown.endMs - shown.startMs > 2 * 86_400_000;
  return (
    <div class="lane-ticks num" aria-hidden="true">
      {ticksOf(shown, width).map((at) => {
        const x = xOf(shown, 100, at);
        return x < 3 || x > 97 ? null : <span key={at} style={{ insetInlineStart: `${x}%` }}>{days || clockTime(at).startsWith("00:00") ? dayText(at) : clockTime(at).slice(0, 5)}</span>;
      })}
    </div>
  );
}
