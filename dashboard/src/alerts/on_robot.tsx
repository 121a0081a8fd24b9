/** A robot's alerts on its page: a strip of those that are open, marks on every plot, and marks on the time bar. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { alertsApi, type Alert } from "../api/alerts";
import type { RobotAlerts } from "../api/schema.js";
import { moment } from "../history/moment";
import { now } from "../live/age";
import { everywhere, marks, type Overlay } from "../panels/plots/overlay";
import { Link } from "../ui/parts";
import { drawMoment, drawSpan } from "./timeline/draw";
import { alertHref, SeverityBadge } from "./badges";
import { TimeBarMarks } from "./timeline/time_bar_marks";
import { isOver, lastsText, mostUrgentFirst } from "./words";
import "../styles/alert_marks.css";

const EVERY_MS = 10_000;
const MOST = 200;
const DAY_MS = 86_400_000;
const SHOWN = 3;

/** Asked anew when the robot's counts change, when another day is looked at, and now and then. */
export function RobotAlerts({ robot, counts }: { robot: string; counts: RobotAlerts }) {
  const alerts = useSignal<Alert[] | null>(null);
  const day = moment.value === null ? null : Math.floor(moment.value / DAY_MS);
  useEffect(() => {
    let gone = false;
    const load = async () => {
      if (document.hidden) return;
      const untilMs = day === null ? undefined : (day + 2) * DAY_MS;
      const answers = await Promise.all([alertsApi.list({ robot, untilMs, limit: MOST }), untilMs && counts.open > 0 ? alertsApi.list({ robot, limit: MOST }) : null]).catch(() => null);
      if (gone || !answers) return;
      const found = new Map(answers.flatMap((answer) => answer?.alerts ?? []).map((one) => [one.id, one]));
      alerts.value = [...found.values()];
    };
    void load();
    const timer = setInterval(() => void load(), EVERY_MS);
    return () => {
      gone = true;
      clearInterval(timer);
    };
  }, [robot, day, JSON.stringify(counts)]);
  useMarks(alerts.value);
  const open = useMemo(() => mostUrgentFirst((alerts.value ?? []).filter((alert) => !isOver(alert) && !alert.quiet)), [alerts.value]);
  if (counts.open === 0 && open.length === 0) return null;
  return <Strip robot={robot} open={open} />;
}

/** Plots and the time bar have them as long as the page shows this robot. */
function useMarks(alerts: Alert[] | null): void {
  useEffect(() => {
    everywhere.value = alerts && alerts.length > 0 ? overlayOf(alerts) : null;
    marks.value = alerts && alerts.length > 0 ? { alerts, View: TimeBarMarks } : null;
  }, [alerts]);
  useEffect(
    () => () => {
      everywhere.value = null;
      marks.value = null;
    },
    [],
  );
}

const TINT = 0.13;

/** Every plot has a flag where an alert began; the plot that it is about shows also how long it went on. */
function overlayOf(alerts: readonly Alert[]): Overlay {
  const isOwn = (plot: { root: HTMLElement }, { series }: Alert) => series !== "" && plot.root.closest<HTMLElement>("[data-topic]")?.dataset.topic === series;
  const told = alerts.filter(({ quiet }) => !quiet);
  return {
    under: (plot, colours) => told.filter((alert) => isOwn(plot, alert)).forEach((alert) => drawSpan(plot, alert, colours, TINT)),
    over: (plot, colours) => {
      for (const alert of told) drawMoment(plot, alert, colours, !isOwn(plot, alert));
      plot.root.parentElement!.dataset.alerts = String(told.length);
    },
  };
}

function Strip({ robot, open }: { robot: string; open: Alert[] }) {
  return (
    <section class="alert-strip" aria-label="Open alerts" data-open-alerts={open.length}>
      {open.length === 0 ? <span class="strip-waits">Asking what is wrong…</span> : (
        <ul>
          {open.slice(0, SHOWN).map((alert) => (
            <li key={alert.id}>
              <Link href={alertHref(alert.id)} class={`strip-alert strip-${alert.severity}`}>
                <SeverityBadge severity={alert.severity} bare />
                <b>{alert.title}</b>
                <span class="strip-reason">{alert.reason}</span>
                <span class="strip-for num">{lastsText(alert, now.value)}</span>
              </Link>
            </li>
          ))}
        </ul>
      )}
      {open.length > 0 && <Link href={`/alerts?robot=${encodeURIComponent(robot)}`} class="strip-all">{open.length > SHOWN ? `all ${open.length}` : "all"}</Link>}
    </section>
  );
}
