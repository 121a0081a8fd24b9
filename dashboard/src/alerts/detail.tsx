/** One alert: what is wrong in words, the values with what was expected, what it groups, what was done, what can be. */

import { Refusal } from "../admin/modal";
import { alertsApi, type AlertDetail, type AlertFinding } from "../api/alerts";
import { now } from "../live/age";
import { clockTime, dayText, duration } from "../ui/format";
import { Link } from "../ui/parts";
import { go, robotHref } from "../ui/url";
import { useWindowKey } from "../ui/use_window_key";
import { ActionsCard } from "./actions";
import { BandCard } from "./timeline/band_plot";
import { ClipCard } from "./clip";
import { alertHref, SeverityBadge, StateChips } from "./badges";
import { RemarksCard } from "./remarks";
import { useAlerts } from "./use_alerts";
import { beganMs, causeWords, endedMs, lastsText } from "./words";

const EVERY_MS = 10_000;

export function AlertPage({ id }: { id: string }) {
  const asked = useAlerts(() => alertsApi.get(id), EVERY_MS);
  const one = asked.value.value;
  useBackKey();
  if (!one) return asked.problem.value ? <Unknown problem={asked.problem.value} /> : <p class="quiet">Asking the gateway…</p>;
  return (
    <div data-alert={one.id} data-severity={one.severity}>
      <header class="robot-head alert-head">
        <p class="crumb"><Link href="/alerts">Alerts</Link> / {one.robot && <><Link href={robotHref(one.robot)}>{one.robot}</Link> /</>}</p>
        <h1>{one.title}</h1>
        <SeverityBadge severity={one.severity} />
        <StateChips alert={one} />
        {one.robot && <Link href={one.path} class="button button-solid alert-go">See {one.robot} at {clockTime(beganMs(one))}</Link>}
      </header>
      <p class={`alert-say side-${one.severity}`}>{one.reason || "The gateway gave no reason."}</p>
      <Refusal text={asked.problem.value} />
      <QuietNote one={one} />
      <div class="alert-split">
        <div class="alert-main">
          {one.series && one.robot && <BandCard alert={one} />}
          {one.findings.length > 0 && <Findings findings={one.findings} />}
          <RemarksCard one={one} refresh={asked.refresh} />
        </div>
        <div class="alert-side">
          <ActionsCard one={one} refresh={asked.refresh} />
          <Facts one={one} />
          <ClipCard one={one} refresh={asked.refresh} />
        </div>
      </div>
    </div>
  );
}

/** Escape leads back to the list, except out of a dialog or a field. */
function useBackKey(): void {
  useWindowKey((event) => {
    const busy = document.querySelector("dialog[open], :popover-open") || (event.target instanceof Element && event.target.matches("input, textarea, select"));
    if (event.key === "Escape" && !busy) go("/alerts");
  });
}

function QuietNote({ one }: { one: AlertDetail }) {
  if (one.inhibited_by) {
    return (
      <p class="alert-note">
        Nobody is notified of it: <Link href={alertHref(one.inhibited_by)} class="text-link">another alert of {one.robot}</Link> explains it.
      </p>
    );
  }
  if (!one.silence) return null;
  return <p class="alert-note">Nobody is notified of it while a <Link href="/alerts/silences" class="text-link">silence</Link> holds.</p>;
}

function Facts({ one }: { one: AlertDetail }) {
  const at = now.value;
  const end = endedMs(one);
  const stamp = (text: string) => `${dayText(Date.parse(text))}, ${clockTime(Date.parse(text))}`;
  const lateS = (Date.parse(one.opened) - beganMs(one)) / 1000;
  const facts: [string, string][] = [
    ["Cause", causeWords(one.cause)],
    ["About", one.series],
    ["Found by", one.detector],
    ["Began", `${stamp(one.first)} by the robot's clock`],
    ["Opened", `${stamp(one.opened)}${lateS > 1 ? `, ${duration(Math.round(lateS))} later` : ""}`],
    ["Lasts", lastsText(one, at)],
    ["Last seen", end === null ? stamp(one.seen) : ""],
    ["Resolved", one.resolved ? `${stamp(one.resolved)} ${one.resolved_by ? `by ${one.resolved_by}` : "by itself"}` : ""],
    ["Acknowledged", one.acknowledged ? `${stamp(one.acknowledged)} by ${one.acknowledged_by}` : ""],
    ["Gateway", one.gateway],
  ];
  return (
    <section class="card" aria-label="Facts">
      <header><h2>Facts</h2></header>
      <dl class="alert-dl">
        {one.robot && <div><dt>Robot</dt><dd><Link href={robotHref(one.robot)} class="text-link">{one.robot}</Link></dd></div>}
        {facts.filter(([, value]) => value !== "").map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="wrap">{value}</dd></div>)}
      </dl>
    </section>
  );
}

function Findings({ findings }: { findings: AlertFinding[] }) {
  return (
    <section class="card" aria-label="Findings" data-findings={findings.length}>
      <header>
        <h2>{findings.length === 1 ? "What was found" : `${findings.length} findings of one cause`}</h2>
      </header>
      <ul class="findings">
        {findings.map((one) => <FindingRow key={`${one.detector} ${one.series}`} one={one} />)}
      </ul>
    </section>
  );
}

function FindingRow({ one }: { one: AlertFinding }) {
  return (
    <li data-active={one.active}>
      <SeverityBadge severity={one.severity} bare />
      <div>
        <p class="wrap">{one.reason}</p>
        <p class="finding-facts">
          <code>{one.detector}</code>
          {one.series && <code>{one.series}</code>}
        </p>
      </div>
      <p class="alert-when num"><span>{clockTime(Date.parse(one.at))}</span>{!one.active && <span>over</span>}</p>
    </li>
  );
}

function Unknown({ problem }: { problem: string }) {
  return (
    <section class="empty">
      <h1>This alert cannot be shown</h1>
      <p class="wrap">{problem}</p>
      <p><Link href="/alerts">All alerts</Link></p>
    </section>
  );
}
