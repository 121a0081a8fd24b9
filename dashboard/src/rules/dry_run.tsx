/** A dry run: when a rule would have fired in the past, and what its targets would have got. Nothing is done. */

import { useSignal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { Badge } from "../admin/badge";
import { Refusal, useAttempt } from "../admin/modal";
import { rulesApi, type DryFiring, type DryRunResult } from "../api/rules";
import { clockTime, dayText, integer } from "../ui/format";
import type { JsonObject } from "../values/json";
import { BACK, lanesOf } from "./times";

const MOST = 500;
const SHOWN = 50;
const LANES = 8;
const TICKS = 4;
const DAY_MS = 86_400_000;

interface Done {
  result: DryRunResult;
  startMs: number;
  endMs: number;
}

export function DryRunPart({ document }: { document: JsonObject | null }) {
  const back = useSignal(BACK[0]![0]);
  const done = useSignal<Done | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const run = () =>
    void attempt(async () => {
      const span = BACK.find(([word]) => word === back.value)![2];
      const endMs = Date.now();
      done.value = { result: await rulesApi.dryRun(document, back.value, MOST), startMs: endMs - span, endMs };
    });
  return (
    <>
      <div class="alert-filters fn-filters">
        <div class="segments" role="group" aria-label="Look back">
          {BACK.map(([value, word]) => <button key={value} type="button" aria-pressed={back.value === value} onClick={() => (back.value = value)}>{word}</button>)}
        </div>
        <button type="button" class="button button-solid rule-run" disabled={busy.value || document === null} onClick={run}>{busy.value ? "Looking…" : "Dry run"}</button>
      </div>
      <Refusal text={problem.value} />
      {done.value ? <Result done={done.value} /> : !problem.value && <p class="nothing">{busy.value ? "The gateway looks at what it has stored…" : "A dry run looks at what is stored of that time and shows when this rule would have fired, as it stands in the editor. Nothing is sent, called or changed."}</p>}
    </>
  );
}

function Result({ done: { result, startMs, endMs } }: { done: Done }) {
  const list = useRef<HTMLOListElement>(null);
  const { firings } = result;
  const show = (firing: DryFiring) => {
    const row = list.current?.querySelectorAll("details")[firings.indexOf(firing)];
    if (!row) return;
    row.open = true;
    row.scrollIntoView({ block: "center" });
    row.querySelector("summary")?.focus();
  };
  return (
    <div data-dry={result.fired}>
      <p class="dry-said" role="status">
        <Badge tone={result.fired > 0 ? "good" : "off"}>{result.fired === 0 ? "would not have fired" : `would have fired ${times(result.fired)}`}</Badge>
        <span class="num">{integer(result.matched)} matched of {integer(result.scanned)} looked at</span>
        {result.truncated && <span class="bad">There was more than a dry run looks at: a shorter time shows all of its own.</span>}
        {result.errors > 0 && <span class="bad">{times(result.errors)} it went wrong: {result.error}</span>}
      </p>
      <section class="card card-lanes" aria-label="When it would have fired">
        <div class="lanes dry-lanes">
          <ol>
            {lanesOf(firings, startMs, endMs, LANES).map(({ name, marks }) => (
              <li key={name} data-lane={name}>
                <span class="lane-name">{name || "no robot"}</span>
                <div class="lane">{marks.slice(0, MOST).map(({ at, firing }, i) => <button key={i} type="button" class="dry-mark" style={{ insetInlineStart: `${at * 100}%` }} aria-label={`${clockTime(Date.parse(firing.at))} ${firing.type}`} title={`${clockTime(Date.parse(firing.at))} ${firing.type}`} onClick={() => show(firing)} />)}</div>
              </li>
            ))}
            {firings.length === 0 && <li><span class="lane-name none">nothing</span><div class="lane" /></li>}
          </ol>
          <p class="lane-ticks num" aria-hidden="true">
            {Array.from({ length: TICKS + 1 }, (_, i) => <span key={i} style={{ insetInlineStart: `${(i * 100) / TICKS}%` }}>{i === TICKS ? "now" : tick(startMs + ((endMs - startMs) * i) / TICKS, endMs - startMs)}</span>)}
          </p>
        </div>
      </section>
      {firings.length > 0 && <ol class="audit dry" ref={list}>{firings.slice(0, SHOWN).map((firing, i) => <Firing key={i} firing={firing} />)}</ol>}
      {firings.length > SHOWN && <p class="hint under">The first {SHOWN} of {integer(result.fired)}.</p>}
    </div>
  );
}

const tick = (ms: number, spanMs: number) => (spanMs > DAY_MS ? dayText(ms) : clockTime(ms).slice(0, 5));
const times = (count: number) => (count === 1 ? "once" : `${integer(count)} times`);

function Firing({ firing }: { firing: DryFiring }) {
  const ms = Date.parse(firing.at);
  return (
    <li data-firing={firing.happening}>
      <details>
        <summary>
          <span class="audit-when num"><span>{Date.now() - ms > DAY_MS && `${dayText(ms)} `}{clockTime(ms)}</span></span>
          <span class="audit-what">{firing.type.replace(/^metaros\./, "")} {firing.robot && <span class="chip">{firing.robot}</span>}{firing.group && firing.group !== firing.robot && <small> {firing.group}</small>}</span>
          <small>{firing.targets.length === 0 ? "only counted" : firing.targets.map(({ id }) => id).join(", ")}</small>
        </summary>
        {firing.targets.map(({ id, kind, payload }) => (
          <div key={id} class="dry-target">
            <p class="hint"><b>{id}</b> <span class="chip">{kind}</span> would have got</p>
            <pre class="fn-log">{typeof payload === "string" ? payload : JSON.stringify(payload, null, 2)}</pre>
          </div>
        ))}
      </details>
    </li>
  );
}
