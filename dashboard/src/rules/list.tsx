/** Every rule: what it listens to, what it does, how often it did, and whether that went well. */

import { useSignal } from "@preact/signals";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { saidOf } from "../api/client";
import { rulesApi, type Rule } from "../api/rules";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { integer } from "../ui/format";
import { Link, MayNot } from "../ui/parts";
import { place, setParam } from "../ui/url";
import { filterWords, lets, ruleHref, SOURCES, sourceOf, sourceWords, targetWords, whenWords, worstFirst } from "./words";
import { inText, momentText } from "./times";

const EVERY_MS = 5000;
const WORDS = Object.fromEntries(SOURCES);

export function RulesPart() {
  const asked = useAsked(rulesApi.list, EVERY_MS);
  const problem = useSignal("");
  const text = place.value.params.get("q") ?? "";
  const all = asked.value.value;
  const shown = all && worstFirst(all.filter((rule) => lets(rule, text)));
  const turn = async (rule: Rule) => {
    problem.value = "";
    await rulesApi.turn(rule.name, !(rule.enabled ?? true)).catch((error: unknown) => (problem.value = `${rule.name}: ${saidOf(error)}`));
    await asked.refresh();
  };
  return (
    <>
      <div class="alert-filters fn-filters" role="search">
        <label class="search">
          <span class="visually-hidden">Search rules</span>
          <input type="search" placeholder="Search   /" value={text} onInput={(event) => setParam("q", event.currentTarget.value)} />
        </label>
        {can("rules.write") ? <Link href="/rules?show=new" class="button button-solid rule-new">New rule…</Link> : <MayNot what="change rules" least="Admins" />}
      </div>
      <Refusal text={asked.problem.value || problem.value} />
      {shown === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : all!.length === 0 ? <Nothing /> : shown.length === 0 ? (
        <p class="quiet">No rule is like that. <button type="button" class="button" onClick={() => setParam("q", "")}>Show all</button></p>
      ) : (
        <table class="admin-table fn-table rule-table">
          <thead>
            <tr>
              <th scope="col"><span class="visually-hidden">On</span></th>
              <th scope="col">Rule</th>
              <th scope="col">Listens to</th>
              <th scope="col">Does</th>
              <th scope="col" class="end">Matched</th>
              <th scope="col" class="end">Fired</th>
              <th scope="col" class="end">Errors</th>
            </tr>
          </thead>
          <tbody>{shown.map((rule) => <Row key={rule.name} rule={rule} onTurn={() => void turn(rule)} />)}</tbody>
        </table>
      )}
    </>
  );
}

function Row({ rule, onTurn }: { rule: Rule; onTurn: () => void }) {
  const { stats } = rule;
  const on = rule.enabled ?? true;
  return (
    <tr data-rule={rule.name} data-off={!on} class="row-link">
      <td class="cell-switch"><Switch on={on} label={rule.name} disabled={!can("rules.write")} onTurn={onTurn} /></td>
      <td class="cell-name"><Link href={ruleHref(rule.name)} class="robot-link">{rule.name}</Link>{rule.description && <span class="sub">{rule.description}</span>}</td>
      <td class="cell-wide" data-label="Listens to"><SourceCell rule={rule} /></td>
      <td class="cell-wide" data-label="Does">{(rule.targets ?? []).length === 0 ? <span class="none">only counts</span> : rule.targets!.map((target, i) => <span key={i} class="rule-does">{targetWords(target)}</span>)}</td>
      <td class="num end" data-label="Matched">{integer(stats.matched)}{stats.groups > 0 && <span class="sub">{integer(stats.groups)} wait</span>}</td>
      <td class="num end" data-label="Fired">{integer(stats.fired)}<span class="sub">{on && rule.next_fire ? `next ${inText(rule.next_fire, now.value)}` : stats.last_fired && `${ageText(now.value - Date.parse(stats.last_fired))} ago`}</span></td>
      <td class={stats.errors > 0 ? "num end bad" : "num end"} data-label="Errors" title={stats.last_error || undefined}>{integer(stats.errors)}{stats.last_error && stats.last_error_at && <span class="sub bad rule-error">{stats.last_error}</span>}</td>
    </tr>
  );
}

function SourceCell({ rule }: { rule: Rule }) {
  const more = [...filterWords(rule), ...whenWords(rule)];
  return (
    <span class="rule-source" title={rule.next_fire ? momentText(rule.next_fire) : undefined}>
      <span><span class="chip">{WORDS[sourceOf(rule)]}</span> {sourceWords(rule)}</span>
      {more.length > 0 && <small>{more.join(" · ")}</small>}
    </span>
  );
}

export function Switch({ on, label, disabled, onTurn }: { on: boolean; label: string; disabled: boolean; onTurn: () => void }) {
  return (
    <button type="button" role="switch" class="toggle" aria-checked={on} aria-label={`${label} is ${on ? "on" : "off"}`} disabled={disabled} onClick={onTurn}><i /></button>
  );
}

function Nothing() {
  return (
    <section class="nothing fn-first">
      <h2>No rule yet</h2>
      <p>A rule says what is to be done when something happens: a battery is low, an alert opens, a message comes, it is three at night. It calls a function, asks a webhook, sends a robot a command, keeps a recording, or raises an alert.</p>
      {can("rules.write") ? <p><Link href="/rules?show=new" class="text-link">Make the first rule</Link>: before it is on, a dry run shows when it would have fired in the last hours.</p> : <MayNot what="make rules" least="Admins" />}
    </section>
  );
}
