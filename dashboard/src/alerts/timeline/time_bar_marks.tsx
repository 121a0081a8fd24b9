/** Alerts on the time bar: a tick for each along its top, and what it was beside the time under the pointer. */

import type { Alert } from "../../api/alerts";
import { xOf, type Window } from "../../history/span";
import { beganMs, endedMs } from "../words";

/** As near as this part of the window the pointer means an alert. */
const NEAR = 1 / 150;

export function TimeBarMarks({ alerts, window: shown, hoverMs }: { alerts: Alert[]; window: Window; hoverMs: number | null }) {
  const slackMs = (shown.endMs - shown.startMs) * NEAR;
  const inView = alerts.filter((alert) => !alert.quiet && beganMs(alert) <= shown.endMs && (endedMs(alert) ?? shown.endMs) >= shown.startMs);
  const pointed = hoverMs === null ? undefined : inView.find((alert) => Math.abs(beganMs(alert) - hoverMs) <= slackMs);
  return (
    <span class="bar-marks" aria-hidden="true" data-bar-marks={inView.length}>
      {inView.map((alert) => {
        const from = Math.max(0, xOf(shown, 100, beganMs(alert)));
        const to = Math.min(100, xOf(shown, 100, endedMs(alert) ?? shown.endMs));
        return <i key={alert.id} class={`bar-mark severity-${alert.severity} ${beganMs(alert) < shown.startMs ? "bar-mark-cut" : ""}`} style={{ insetInlineStart: `${from}%`, inlineSize: `${Math.max(0, to - from)}%` }} />;
      })}
      {pointed && (
        <span class={`bar-said strip-${pointed.severity}`} style={{ insetInlineStart: `clamp(90px, ${xOf(shown, 100, beganMs(pointed)).toFixed(2)}%, calc(100% - 90px))` }}>
          {pointed.title}
        </span>
      )}
    </span>
  );
}
