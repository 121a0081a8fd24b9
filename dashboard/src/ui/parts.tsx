/** Small pieces that every view shares. */

import type { ComponentChildren } from "preact";
import type { Missing } from "../api/history_types";
import { signedIn, whyNot } from "../api/session";
import { ageText, now, STALE_AFTER_MS } from "../live/age";
import type { Health } from "../live/fleet";
import { reasonWords } from "./reasons";
import { useLive } from "./context";
import { clockTime } from "./format";
import { go, here } from "./url";

const SHAPES: Record<Health, { word: string; path: string }> = {
  online: { word: "online", path: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z" },
  attention: { word: "attention", path: "M6 .8 11.6 11H.4Z" },
  offline: { word: "offline", path: "M1.5 1.5h9v9h-9Zm2 2v5h5v-5Z" },
};

/** A state as colour, shape and word, so that no one of them is needed alone. */
export function StateBadge({ state, note }: { state: Health; note?: string }) {
  const { word, path } = SHAPES[state];
  return (
    <span class={`state state-${state}`} data-state={state} title={note}>
      <svg viewBox="0 0 12 12" aria-hidden="true">
        <path d={path} fill-rule="evenodd" />
      </svg>
      {word}
    </span>
  );
}

/** `label` says it to who does not see the content. */
export function Link(props: { href: string; class?: string; current?: boolean; label?: string; children?: ComponentChildren }) {
  return (
    <a
      href={props.href}
      class={props.class}
      aria-current={props.current ? "page" : undefined}
      aria-label={props.label}
      onClick={(event) => {
        if (event.ctrlKey || event.metaKey || event.shiftKey || event.button !== 0) return;
        event.preventDefault();
        go(props.href);
      }}
    >
      {props.children}
    </a>
  );
}

/** In the place of what the person may not do: who may, and the way to become one of them. */
export function MayNot({ what, least }: { what: string; least?: "Admins" }) {
  return (
    <p class="may-not" data-may-not={what}>
      {whyNot(what, least)} {!signedIn.value && <Link href={`/signin?back=${encodeURIComponent(here())}`}>Sign in</Link>}
    </p>
  );
}

export function Card(props: {
  title: string;
  note?: ComponentChildren;
  kind: string;
  topic?: string;
  stampMs?: number | null;
  /** In the past: nothing is stored at the instant. */
  missing?: Missing | null;
  children: ComponentChildren;
}) {
  return (
    <section class={`card card-${props.kind}`} data-card={props.kind} data-topic={props.topic} aria-label={props.title}>
      <header>
        <h2>{props.title}</h2>
        <span class="note">{props.note}</span>
        {props.stampMs !== undefined && !props.missing && <Freshness receivedMs={props.stampMs} />}
      </header>
      {props.missing && <Absent missing={props.missing} />}
      {props.children}
    </section>
  );
}

/** Says when what is shown is old, or that nothing has come yet; says nothing while it is current. */
export function Freshness({ receivedMs }: { receivedMs: number | null }) {
  const { at, past } = useLive();
  if (past) return <PastAge ageMs={receivedMs === null ? null : at.value - receivedMs} />;
  return <LiveAge receivedMs={receivedMs} />;
}

/** Up to this long before the instant a stored sample stands for it; what is older is greyed. */
const STANDS_MS = 10_000;

function PastAge({ ageMs }: { ageMs: number | null }) {
  if (ageMs === null || ageMs < 950) return null;
  return <span class={ageMs > STANDS_MS ? "age age-stale" : "age"}>{ageText(ageMs)} before</span>;
}

/** Nothing is stored at the instant: says why, and when something last was. */
export function Absent({ missing: { reason, nearest_ms: nearest } }: { missing: Missing }) {
  const at = useLive().at.value;
  const why = ABSENT[reason] ?? reasonWords(reason);
  return (
    <p class="absent" data-absent={reason}>
      <b>No data here</b> {why}
      {nearest !== null && <span> · last stored {clockTime(nearest)}, {ageText(at - nearest)} before</span>}
    </p>
  );
}

const ABSENT: Record<string, string> = {
  not_stored: "nothing is stored of it",
  too_old: "nothing came in the minute before",
};

function LiveAge({ receivedMs }: { receivedMs: number | null }) {
  const at = now.value;
  if (receivedMs === null) return <span class="age">waiting…</span>;
  const age = at - receivedMs;
  return age > STALE_AFTER_MS ? <span class="age age-stale">{ageText(age)} old</span> : null;
}

export function Spark({ values, top }: { values: number[]; top: number }) {
  if (values.length < 2) return null;
  const step = 60 / (values.length - 1);
  const points = values.map((value, i) => `${(i * step).toFixed(1)},${(15 - (14 * Math.min(value, top)) / top).toFixed(1)}`);
  return (
    <svg class="spark" viewBox="0 0 60 16" preserveAspectRatio="none" aria-hidden="true">
      <polyline points={points.join(" ")} />
    </svg>
  );
}
