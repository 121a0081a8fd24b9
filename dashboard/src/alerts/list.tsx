/** The alerts of the last hours: their timeline, filters, and the list, the most urgent first. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { alertsApi, type Alert } from "../api/alerts";
import { saidOf } from "../api/client";
import { can } from "../api/session";
import { now } from "../live/age";
import { place, setParam } from "../ui/url";
import { useWindowKey } from "../ui/use_window_key";
import { AlertRow } from "./alert_row";
import { filterOf, isFiltered, lets, SPANS, STATE_CHOICES, USUAL_SPAN, type Filter } from "./filter";
import { AlertTimeline } from "./timeline/timeline";
import { useAlerts } from "./use_alerts";
import { mostUrgentFirst, SEVERITIES } from "./words";

const MOST = 500;
const SHOWN = 100;
/** The timeline moves on with the clock, a pixel or so at a time. */
const STEPS = 600;
const NARROW = matchMedia("(max-width: 760px)");

export function AlertsPart() {
  const params = place.value.params;
  const filter = filterOf(params);
  const span = params.get("span") ?? "";
  const spanMs = SPANS[span] ?? SPANS[USUAL_SPAN]!;
  const asked = useAlerts(() => alertsApi.list({ fromMs: Date.now() - spanMs, limit: MOST }));
  const found = asked.value.value;
  useEffect(() => void asked.refresh(), [spanMs]);
  const step = spanMs / STEPS;
  const endMs = Math.ceil(now.value / step) * step;
  const shown = useMemo(() => ({ startMs: endMs - spanMs, endMs }), [endMs, spanMs]);
  const all = found?.alerts ?? [];
  const inTime = useMemo(() => all.filter((alert) => lets(alert, filter, true)), [found, params.toString()]);
  return (
    <>
      <Filters all={all} filter={filter} span={span in SPANS ? span : USUAL_SPAN} />
      <Refusal text={asked.problem.value} />
      {found === null ? <p class="quiet">Asking the gateway…</p> : (
        <>
          <AlertTimeline alerts={inTime} window={shown} narrow={NARROW.matches} />
          {found.next && <p class="hint under">These are the newest {MOST} alerts of that time; a shorter time shows all of its own.</p>}
          <Rows alerts={inTime} filter={filter} any={all.length > 0} refresh={asked.refresh} />
        </>
      )}
    </>
  );
}

function Filters({ all, filter, span }: { all: Alert[]; filter: Filter; span: string }) {
  const robots = useMemo(() => [...new Set([...all.map(({ robot }) => robot), filter.robot])].filter(Boolean).sort((a, b) => a.localeCompare(b, "en", { numeric: true })), [all, filter.robot]);
  const count = (state: Filter["state"]) => all.filter((alert) => lets(alert, { ...filter, state })).length;
  return (
    <div class="alert-filters" role="search">
      <div class="segments" role="group" aria-label="State">
        {STATE_CHOICES.map(([state, word]) => (
          <button key={state} type="button" aria-pressed={filter.state === state} onClick={() => setParam("state", state)}>{word} <small class="num">{count(state)}</small></button>
        ))}
      </div>
      <div class="segments" role="group" aria-label="Severity">
        {["", ...SEVERITIES].map((word) => (
          <button key={word} type="button" aria-pressed={filter.severity === word} onClick={() => setParam("severity", word)}>{word || "any"}</button>
        ))}
      </div>
      <select aria-label="Robot" value={filter.robot} onChange={(event) => setParam("robot", event.currentTarget.value)}>
        <option value="">every robot</option>
        {robots.map((robot) => <option key={robot} value={robot}>{robot}</option>)}
      </select>
      <label class="search">
        <span class="visually-hidden">Search alerts</span>
        <input type="search" placeholder="Search   /" value={filter.text} onInput={(event) => setParam("q", event.currentTarget.value)} />
      </label>
      <div class="segments" role="group" aria-label="Time">
        {Object.keys(SPANS).map((word) => (
          <button key={word} type="button" aria-pressed={word === span} onClick={() => setParam("span", word, USUAL_SPAN)}>{word}</button>
        ))}
      </div>
    </div>
  );
}

function Rows({ alerts, filter, any, refresh }: { alerts: Alert[]; filter: Filter; any: boolean; refresh: () => Promise<void> }) {
  const most = useSignal(SHOWN);
  const problem = useSignal("");
  const list = useRef<HTMLOListElement>(null);
  const sorted = useMemo(() => mostUrgentFirst(alerts.filter((alert) => lets(alert, filter))), [alerts, filter.state]);
  const acknowledge = async (alert: Alert) => {
    problem.value = "";
    await alertsApi.acknowledge(alert.id).catch((error: unknown) => (problem.value = `${alert.robot}: ${saidOf(error)}`));
    await refresh();
  };
  useListKeys(list, (id) => {
    const alert = sorted.find((one) => one.id === id);
    if (alert?.state === "open" && can("alerts.handle")) void acknowledge(alert);
  });
  if (sorted.length === 0) return <Nothing filter={filter} any={any} />;
  return (
    <>
      <Refusal text={problem.value} />
      <ol class="alerts" ref={list} aria-label="Alerts">
        {sorted.slice(0, most.value).map((alert) => <AlertRow key={alert.id} alert={alert} onAcknowledge={() => void acknowledge(alert)} />)}
      </ol>
      {sorted.length > most.value && (
        <p class="lanes-more"><button type="button" class="button" onClick={() => (most.value += SHOWN)}>{SHOWN} more of {sorted.length - most.value}</button></p>
      )}
      <p class="hint under alert-keys"><kbd>j</kbd> <kbd>k</kbd> next and previous · <kbd>Enter</kbd> open · <kbd>a</kbd> acknowledge</p>
    </>
  );
}

/** `j`, `k` and the arrows move the focus along the rows, `a` acknowledges the one that has it. */
function useListKeys(list: { current: HTMLOListElement | null }, acknowledge: (id: string) => void): void {
  useWindowKey((event) => {
    const target = event.target instanceof Element ? event.target : null;
    if (target?.closest("input, textarea, select, dialog") || event.ctrlKey || event.metaKey || event.altKey || !list.current) return;
    const links = [...list.current.querySelectorAll<HTMLElement>(".alert-link")];
    const at = links.findIndex((link) => link.closest("li")?.contains(document.activeElement));
    const inside = at >= 0;
    const step = event.key === "j" || (inside && event.key === "ArrowDown") ? 1 : event.key === "k" || (inside && event.key === "ArrowUp") ? -1 : 0;
    if (step !== 0) {
      event.preventDefault();
      links[inside ? Math.max(0, Math.min(links.length - 1, at + step)) : 0]?.focus();
    } else if (event.key === "a" && inside) {
      acknowledge(links[at]!.closest("li")!.dataset.alertRow!);
    }
  });
}

function Nothing({ filter, any }: { filter: Filter; any: boolean }) {
  if (any && isFiltered(filter)) return <p class="quiet">No alert is like that. <button type="button" class="button" onClick={clear}>Show all</button></p>;
  return (
    <section class="all-well">
      <svg viewBox="0 0 40 40" aria-hidden="true"><circle cx="20" cy="20" r="18" /><path d="m12 21 6 6 11-13" /></svg>
      <div>
        <h2>Nothing is wrong</h2>
        <p>
          {any ? "What there was is over; the timeline and “resolved” show it." : "No alert in this time."} The gateway goes on watching links, topics, nodes and every
          number that robots send.
        </p>
      </div>
    </section>
  );
}

function clear(): void {
  for (const name of ["severity", "robot", "q"]) setParam(name, "");
  setParam("state", "all");
}

