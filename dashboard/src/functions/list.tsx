/** Every function: what calls it, how often, how well, how fast, and what could not be delivered to it. */

import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { functionsApi, type FunctionRow } from "../api/functions";
import { can } from "../api/session";
import { integer } from "../ui/format";
import { Link, MayNot } from "../ui/parts";
import { go, place, setParam } from "../ui/url";
import { lazy } from "../views/lazy";
import { RuntimeStrip } from "./runtime_strip";
import { Trend } from "./trend";
import { CANARY_TONES, CANARY_WORDS, errorShare, functionHref, lets, milliseconds, stateTone, stateWord, triggerKind, triggerWords, USUAL_WINDOW, WINDOWS, worstFirst } from "./words";

const EVERY_MS = 5000;
const SHOWN_TRIGGERS = 2;
const DeployDialog = lazy(async () => (await import("./deploy")).DeployDialog, null);

export function FunctionsPart() {
  const params = place.value.params;
  const span = params.get("span") ?? "";
  const windowS = WINDOWS[span] ?? WINDOWS[USUAL_WINDOW]!;
  const asked = useAsked(() => functionsApi.list(windowS), EVERY_MS);
  const deploying = useSignal(false);
  const text = params.get("q") ?? "";
  const all = asked.value.value;
  const shown = all && worstFirst(all.filter((row) => lets(row, text)));
  return (
    <>
      <RuntimeStrip />
      <div class="alert-filters fn-filters" role="search">
        <label class="search">
          <span class="visually-hidden">Search functions</span>
          <input type="search" placeholder="Search   /" value={text} onInput={(event) => setParam("q", event.currentTarget.value)} />
        </label>
        <div class="segments" role="group" aria-label="Time">
          {Object.keys(WINDOWS).map((word) => (
            <button key={word} type="button" aria-pressed={windowS === WINDOWS[word]} onClick={() => (setParam("span", word, USUAL_WINDOW), void asked.refresh())}>{word}</button>
          ))}
        </div>
        {can("functions.write") ? <button type="button" class="button button-solid" onClick={() => (deploying.value = true)}>Deploy…</button> : <MayNot what="deploy functions" least="Admins" />}
      </div>
      <Refusal text={asked.problem.value} />
      {shown === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : all!.length === 0 ? <Nothing onDeploy={() => (deploying.value = true)} /> : shown.length === 0 ? (
        <p class="quiet">No function is like that. <button type="button" class="button" onClick={() => setParam("q", "")}>Show all</button></p>
      ) : <Rows rows={shown} />}
      {deploying.value && <DeployDialog onClose={() => (deploying.value = false)} onDone={({ name }) => go(functionHref(name, "test"))} />}
    </>
  );
}

function Rows({ rows }: { rows: FunctionRow[] }) {
  return (
    <table class="admin-table fn-table">
      <thead>
        <tr>
          <th scope="col">Function</th>
          <th scope="col">Called by</th>
          <th scope="col" class="end">Calls</th>
          <th scope="col" class="end">Errors</th>
          <th scope="col" class="end">p95</th>
          <th scope="col" class="end">Cold starts</th>
          <th scope="col">Trend</th>
          <th scope="col">State</th>
        </tr>
      </thead>
      <tbody>{rows.map((row) => <Row key={row.name} row={row} />)}</tbody>
    </table>
  );
}

function Row({ row }: { row: FunctionRow }) {
  const { stats } = row;
  return (
    <tr data-function={row.name} class="row-link">
      <td class="cell-name">
        <Link href={functionHref(row.name)} class="robot-link">{row.name}</Link>
        <span class="sub">{row.description || <code>{row.handler}</code>}</span>
      </td>
      <td class="cell-wide" data-label="Called by"><Triggers row={row} /></td>
      <td class="num end" data-label="Calls">{integer(stats.invocations)}{stats.running > 0 && <span class="sub">{stats.running} running</span>}</td>
      <td class={stats.errors > 0 ? "num end bad" : "num end"} data-label="Errors">{integer(stats.errors)}<span class="sub">{stats.throttles > 0 ? `${integer(stats.throttles)} throttled` : errorShare(stats)}</span></td>
      <td class="num end" data-label="p95">{milliseconds(stats.p95_ms)}</td>
      <td class="num end" data-label="Cold starts">{integer(stats.cold_starts)}</td>
      <td class="cell-trend" data-label="Trend"><Trend stats={stats} /></td>
      <td data-label="State"><StateCell row={row} /></td>
    </tr>
  );
}

function Triggers({ row: { triggers } }: { row: FunctionRow }) {
  if (triggers.length === 0) return <span class="none">nothing yet</span>;
  return (
    <span class="fn-triggers">
      {triggers.slice(0, SHOWN_TRIGGERS).map((one) => (
        <span key={one.id} class="fn-trigger" data-off={!one.enabled} title={one.title}><small>{triggerKind(one.kind)}</small> {triggerWords(one)}</span>
      ))}
      {triggers.length > SHOWN_TRIGGERS && <small>and {triggers.length - SHOWN_TRIGGERS} more</small>}
    </span>
  );
}

function StateCell({ row }: { row: FunctionRow }) {
  const canary = row.aliases.find((alias) => alias.canary?.state === "running" || alias.canary?.state === "rolled_back")?.canary;
  const { dead_letters: dead, waiting } = row.stats;
  return (
    <span class="fn-state" title={row.reason || undefined}>
      <Badge tone={stateTone(row.state)}>{stateWord(row.state)}</Badge>
      {canary && <Badge tone={CANARY_TONES[canary.state]}>{CANARY_WORDS[canary.state]}</Badge>}
      {dead > 0 && <Link href={functionHref(row.name, "dead")} class="fn-dead">{integer(dead)} dead letter{dead === 1 ? "" : "s"}</Link>}
      {waiting > 0 && <small class="num">{integer(waiting)} wait</small>}
    </span>
  );
}

function Nothing({ onDeploy }: { onDeploy: () => void }) {
  return (
    <section class="nothing fn-first">
      <h2>No function yet</h2>
      <p>A function is a Python file that runs here when something happens: an alert, a message on a topic, a low battery, a schedule.</p>
      <pre>{`def handler(event, context):\n    print(event["detail-type"], event["detail"])\n    return {"seen": True}`}</pre>
      <p>Deploy it with <code>metaros function deploy greet handler.py</code>, with boto3 against <code>/lambda</code>, or {can("functions.write") ? <button type="button" class="button" onClick={onDeploy}>drop its zip here…</button> : "ask an admin"}. Then a rule calls it.</p>
    </section>
  );
}
