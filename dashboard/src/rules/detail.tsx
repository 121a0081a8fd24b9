/** One rule, or a new one: what it does in words, its editor, its dry run, and who changed it. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Badge } from "../admin/badge";
import { Confirm, Refusal, useAttempt, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rulesApi, type Document, type Rule } from "../api/rules";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { integer } from "../ui/format";
import { Link, MayNot } from "../ui/parts";
import { go, place, replace, setParam } from "../ui/url";
import { lazy } from "../views/lazy";
import { documentOf, NEW, read, textOf } from "./document";
import { RuleEditor, useFaults } from "./editor";
import { Switch } from "./list";
import { TargetSecrets } from "./secrets";
import { inText, momentText } from "./times";
import { filterWords, ruleHref, sourceWords, targetWords, whenWords } from "./words";

const EVERY_MS = 5000;
const DryRunPart = lazy(async () => (await import("./dry_run")).DryRunPart);
const HistoryPart = lazy(async () => (await import("./history")).HistoryPart);

export function RulePage({ name }: { name: string }) {
  const asked = useAsked(() => rulesApi.get(name), EVERY_MS);
  const rule = asked.value.value;
  if (rule) return <Editing rule={rule} refresh={asked.refresh} problem={asked.problem.value} />;
  if (!asked.problem.value) return <p class="quiet">Asking the gateway…</p>;
  return <section class="empty"><h1>{name}</h1><Refusal text={asked.problem.value} /><p><Link href="/rules">All rules</Link></p></section>;
}

export const NewRule = () => (can("rules.write") ? <Editing rule={null} refresh={async () => {}} problem="" /> : <MayNot what="make rules" least="Admins" />);

interface EditingProps {
  rule: Rule | null;
  refresh: () => Promise<void>;
  problem: string;
}

function Editing({ rule, refresh, problem }: EditingProps) {
  const stored = textOf(rule ? documentOf(rule) : NEW);
  const text = useSignal(stored);
  const base = useSignal({ revision: rule?.revision ?? 0, text: stored });
  useEffect(() => {
    if (!rule || rule.revision === base.peek().revision) return;
    if (text.peek() === base.peek().text) {
      text.value = stored; // nothing was typed: what somebody else made of it is shown
      base.value = { revision: rule.revision, text: stored };
    }
  }, [rule?.revision]);
  const { document } = read(text.value);
  const checked = useFaults(document);
  const faults = (document && checked.faults.value) || [];
  const tab = place.value.params.get("tab") ?? "";
  const dirty = text.value !== base.value.text;
  const moved = rule !== null && rule.revision !== base.value.revision;
  const tabs: [string, string][] = [["", "Rule"], ["try", "Dry run"], ...(rule ? ([["history", "History"]] as [string, string][]) : [])];
  const takeTheirs = () => {
    text.value = stored;
    base.value = { revision: rule?.revision ?? 0, text: stored };
  };
  const saved = (made: Rule) => {
    const mine = textOf(documentOf(made));
    text.value = mine;
    base.value = { revision: made.revision, text: mine };
    if (rule) void refresh();
    else replace(ruleHref(made.name));
  };
  return (
    <div data-rule-page={rule?.name ?? ""}>
      <Head rule={rule} refresh={refresh} />
      <Refusal text={problem || checked.problem.value} />
      {rule && <Said rule={rule} />}
      {moved && dirty && <p class="moved" role="alert">Somebody else changed this rule meanwhile: it is at revision {rule.revision}. <button type="button" class="button" onClick={takeTheirs}>Drop mine, show theirs</button></p>}
      <nav class="tabs" aria-label="Rule">{tabs.map(([path, word]) => <button key={path} type="button" aria-current={path === tab ? "page" : undefined} onClick={() => setParam("tab", path)}>{word}</button>)}</nav>
      {tab === "try" ? <DryRunPart document={document} /> : tab === "history" && rule ? <HistoryPart rule={rule} /> : can("rules.write") ? (
        <>
          <RuleEditor text={text} faults={faults} isNew={!rule} />
          <Foot document={document} revision={base.value.revision} dirty={dirty} faulty={faults.length > 0} isNew={!rule} onReset={takeTheirs} onSaved={saved} />
          {rule && <TargetSecrets rule={rule} />}
        </>
      ) : <ReadOnly text={stored} />}
    </div>
  );
}

function Head({ rule, refresh }: { rule: Rule | null; refresh: () => Promise<void> }) {
  const question = useSignal<Question | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const on = rule?.enabled ?? true;
  return (
    <header class="robot-head alert-head">
      <p class="crumb"><Link href="/rules">Rules</Link> /</p>
      <h1>{rule?.name ?? "New rule"}</h1>
      {rule && <Switch on={on} label={rule.name} disabled={!can("rules.write") || busy.value} onTurn={() => void attempt(async () => (await rulesApi.turn(rule.name, !on), await refresh()))} />}
      {rule && <Badge tone={on ? "good" : "off"}>{on ? "on" : "off"}</Badge>}
      {rule && can("rules.write") && <span class="fn-acts alert-go"><button type="button" class="button" onClick={() => (question.value = removal(rule))}>Delete…</button></span>}
      <Refusal text={problem.value} />
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </header>
  );
}

const removal = (rule: Rule): Question => ({
  title: `Delete the rule ${rule.name}?`,
  text: <p>It fires no more, and what it waits for is forgotten. What it set off already is delivered all the same.</p>,
  yes: "Delete it",
  run: async () => {
    await rulesApi.remove(rule.name, rule.revision);
    go("/rules");
  },
});

/** What it does in a sentence, and what it did in figures. */
function Said({ rule }: { rule: Rule }) {
  const { stats } = rule;
  const only = [...filterWords(rule), ...whenWords(rule)];
  const does = (rule.targets ?? []).map(targetWords);
  return (
    <>
      <p class="rule-said"><b>{sourceWords(rule)}</b>{only.length > 0 && <>, {only.join(", ")}</>}: {does.length > 0 ? does.join(", then ") : "only counts"}.{rule.description && <span> {rule.description}</span>}</p>
      <div class="fn-figures">
        <dl>
          <Figure word="Matched" value={integer(stats.matched)} note={stats.groups > 0 ? `${integer(stats.groups)} wait` : ""} />
          <Figure word="Fired" value={integer(stats.fired)} note={stats.last_fired ? `${ageText(now.value - Date.parse(stats.last_fired))} ago` : "never yet"} />
          <Figure word="Errors" value={integer(stats.errors)} note={stats.last_error_at ? `${ageText(now.value - Date.parse(stats.last_error_at))} ago` : ""} bad={stats.errors > 0} />
          {rule.next_fire && <Figure word="Next" value={inText(rule.next_fire, now.value)} note={momentText(rule.next_fire)} />}
          <Figure word="By" value={rule.maker.name || "–"} note={`revision ${rule.revision}, ${ageText(now.value - Date.parse(rule.changed))} ago`} />
        </dl>
      </div>
      {stats.last_error && <p class="refusal rule-last">{stats.last_error}</p>}
    </>
  );
}

const Figure = ({ word, value, note, bad = false }: { word: string; value: string; note: string; bad?: boolean }) => (
  <div data-figure={word}><dt>{word}</dt><dd class={bad ? "num bad" : "num"}>{value}<small>{note}</small></dd></div>
);

interface FootProps {
  document: ReturnType<typeof read>["document"];
  revision: number;
  dirty: boolean;
  faulty: boolean;
  isNew: boolean;
  onReset: () => void;
  onSaved: (rule: Rule) => void;
}

function Foot({ document, revision, dirty, faulty, isNew, onReset, onSaved }: FootProps) {
  const { busy, problem, attempt } = useAttempt();
  const save = () => void attempt(async () => onSaved(await rulesApi.put(document!, revision)));
  const name = document ? String((document as unknown as Document).name ?? "") : "";
  return (
    <div class="rule-foot">
      <Refusal text={problem.value} />
      <div class="dialog-end">
        <span class="hint">{isNew ? "" : dirty ? "Not saved yet." : "Saved."}</span>
        {dirty && !isNew && <button type="button" class="button" onClick={onReset}>Drop changes</button>}
        <button type="button" class="button" onClick={() => setParam("tab", "try")} disabled={document === null}>Dry run…</button>
        <button type="button" class="button button-solid" disabled={busy.value || document === null || faulty || name === "" || (!dirty && !isNew)} onClick={save}>{isNew ? "Make it" : "Save"}</button>
      </div>
    </div>
  );
}

const ReadOnly = ({ text }: { text: string }) => (
  <>
    <MayNot what="change rules" least="Admins" />
    <pre class="rule-read" tabIndex={0}>{text}</pre>
  </>
);

