/** Dead letters: what could not be delivered and why, to redrive or to drop. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Confirm, Refusal, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { saidOf } from "../api/client";
import { functionsApi, type DeadChoice, type DeadLetter } from "../api/functions";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { integer } from "../ui/format";
import { Link, MayNot } from "../ui/parts";
import { robotHref } from "../ui/url";
import { functionHref } from "./words";

const EVERY_MS = 5000;
const PAGE = 100;

/** Of one target, or with an empty kind every one. */
export function DeadLettersPart({ kind = "", target = "" }: { kind?: string; target?: string }) {
  const asked = useAsked(() => functionsApi.dead(kind, target, PAGE), EVERY_MS);
  const picked = useSignal<ReadonlySet<string>>(new Set());
  const question = useSignal<Question | null>(null);
  const said = useSignal("");
  const rows = asked.value.value?.dead_letters ?? null;
  const here = (rows ?? []).filter(({ id }) => picked.value.has(id)).map(({ id }) => id);
  const whole: DeadChoice = kind || target ? { kind, target } : { all: true };
  const more = asked.value.value?.next != null;
  const ask = (what: "redrive" | "drop") => {
    const choice = here.length > 0 ? { ids: here } : whole;
    const count = here.length > 0 ? letters(here.length) : more ? "all dead letters" : letters(rows!.length);
    question.value = questionOf(what, choice, count, async (done) => {
      said.value = done;
      picked.value = new Set();
      await asked.refresh();
    });
  };
  if (!can("dead_letters.read")) return <MayNot what="see dead letters" />;
  return (
    <>
      <div class="section-head dead-head">
        <p class="hint">{target ? "Events that it failed at, as often as they are tried." : "What could not be delivered to functions, webhooks, robots and clouds."} They wait here until somebody delivers them again or drops them.</p>
        {rows !== null && rows.length > 0 && (can("dead_letters.write") ? (
          <span class="fn-acts">
            <button type="button" class="button" onClick={() => ask("drop")}>Drop {here.length > 0 ? here.length : "all"}…</button>
            <button type="button" class="button button-solid" onClick={() => ask("redrive")}>Redrive {here.length > 0 ? here.length : "all"}…</button>
          </span>
        ) : <MayNot what="redrive and drop dead letters" />)}
      </div>
      <p class={said.value ? "taught" : "visually-hidden"} role="status">{said.value}</p>
      <Refusal text={asked.problem.value} />
      {rows === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : rows.length === 0 ? <Nothing /> : (
        <ol class="audit dead">{rows.map((one) => <Letter key={one.id} one={one} whole={target !== ""} picked={picked} />)}</ol>
      )}
      {more && <p class="hint under">These are the newest {PAGE}.</p>}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </>
  );
}

function Letter({ one, whole, picked }: { one: DeadLetter; whole: boolean; picked: Signal<ReadonlySet<string>> }) {
  const open = useSignal(false);
  const flip = () => {
    const next = new Set(picked.value);
    if (!next.delete(one.id)) next.add(one.id);
    picked.value = next;
  };
  return (
    <li data-dead={one.id}>
      <details onToggle={(event) => (open.value = event.currentTarget.open)}>
        <summary>
          <input type="checkbox" aria-label={`Choose ${one.id}`} checked={picked.value.has(one.id)} onClick={(event) => event.stopPropagation()} onChange={flip} />
          <span class="audit-when num" title={one.ended}><span>{ageText(now.value - Date.parse(one.ended))}</span> ago</span>
          <span class="audit-what">
            {!whole && <><span class="chip">{one.kind}</span> <b>{one.target}</b> </>}
            <b class="bad">{one.code}</b> {one.message}
            {one.robot && <> <Link href={robotHref(one.robot)} class="chip chip-link">{one.robot}</Link></>}
          </span>
          <small class="num">{one.tries} tr{one.tries === 1 ? "y" : "ies"}{one.redrives > 0 && `, ${one.redrives}× redriven`}</small>
        </summary>
        {open.value && <Payload id={one.id} one={one} />}
      </details>
    </li>
  );
}

function Payload({ id, one }: { id: string; one: DeadLetter }) {
  const found = useSignal<DeadLetter | null>(null);
  const problem = useSignal("");
  useEffect(() => void functionsApi.deadLetter(id).then((letter) => (found.value = letter), (error: unknown) => (problem.value = saidOf(error))), [id]);
  return (
    <>
      <dl class="call-facts">
        <div><dt>Event</dt><dd><code>{one.happening || "a call"}</code></dd></div>
        <div><dt>Accepted</dt><dd class="num">{one.born}</dd></div>
        {one.kind === "function" && <div><dt>Function</dt><dd><Link href={functionHref(one.target.split(":")[0]!)} class="text-link">{one.target}</Link></dd></div>}
      </dl>
      <Refusal text={problem.value} />
      <pre class="fn-log">{found.value ? pretty(found.value.payload ?? "") + (found.value.truncated ? "\n… cut" : "") : "…"}</pre>
    </>
  );
}

const letters = (count: number) => `${integer(count)} dead letter${count === 1 ? "" : "s"}`;

function pretty(text: string): string {
  try {
    return JSON.stringify(JSON.parse(text), null, 2);
  } catch {
    return text;
  }
}

function questionOf(what: "redrive" | "drop", choice: DeadChoice, count: string, done: (said: string) => Promise<void>): Question {
  const redrive = what === "redrive";
  return {
    title: redrive ? `Deliver ${count} again?` : `Drop ${count}?`,
    text: redrive ? <p>They are delivered as if they had just been accepted, with all their tries. Those that fail once more come back here.</p> : <p>They are gone for good: nothing will deliver them.</p>,
    yes: redrive ? "Deliver again" : "Drop",
    run: async () => {
      const number = redrive ? await functionsApi.redrive(choice) : await functionsApi.drop(choice);
      await done(redrive ? `${letters(number)} on ${number === 1 ? "its" : "their"} way again.` : `${letters(number)} dropped.`);
    },
  };
}

const Nothing = () => (
  <section class="all-well">
    <svg viewBox="0 0 40 40" aria-hidden="true"><circle cx="20" cy="20" r="18" /><path d="m12 21 6 6 11-13" /></svg>
    <div>
      <h2>Nothing was given up on</h2>
      <p>What cannot be delivered after all its tries stands here with its reason; nothing is lost on the way.</p>
    </div>
  </section>
);
