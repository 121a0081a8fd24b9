/** One function: its head with the figures that count, and its parts, one at a time. */

import { useEffect } from "preact/hooks";
import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Confirm, Refusal, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { functionsApi, type FunctionDetail } from "../api/functions";
import { can } from "../api/session";
import { duration, integer } from "../ui/format";
import { Link } from "../ui/parts";
import { go, place, setParam } from "../ui/url";
import { lazy } from "../views/lazy";
import { OverviewPart } from "./overview";
import type { PartProps } from "./part_props";
import { errorShare, functionHref, milliseconds, stateTone, stateWord, USUAL_WINDOW, WINDOWS } from "./words";

const EVERY_MS = 5000;
const InvocationsPart = lazy(async () => (await import("./invocations")).InvocationsPart);
const LogPart = lazy(async () => (await import("./log")).LogPart);
const TestCallPart = lazy(async () => (await import("./test_call")).TestCallPart);
const CodePart = lazy(async () => (await import("./code")).CodePart);
const DeadLettersPart = lazy(async () => (await import("./dead_letters")).DeadLettersPart);
const DeployDialog = lazy(async () => (await import("./deploy")).DeployDialog, null);

const TABS: [string, string, (props: PartProps) => preact.ComponentChild][] = [
  ["", "Overview", (props) => <OverviewPart {...props} />],
  ["invocations", "Invocations", ({ one }) => <InvocationsPart name={one.name} />],
  ["log", "Log", ({ one }) => <LogPart name={one.name} />],
  ["test", "Test", (props) => <TestCallPart {...props} />],
  ["code", "Code", ({ one }) => <CodePart key={one.code_sha256} one={one} />],
  ["dead", "Dead letters", ({ one }) => <DeadLettersPart kind="function" target={one.name} />],
];

export function FunctionPage({ name }: { name: string }) {
  const params = place.value.params;
  const tab = TABS.find(([path]) => path === (params.get("tab") ?? "")) ?? TABS[0]!;
  const windowS = WINDOWS[params.get("span") ?? ""] ?? WINDOWS[USUAL_WINDOW]!;
  const asked = useAsked(() => functionsApi.get(name, windowS), EVERY_MS);
  useEffect(() => void asked.refresh(), [windowS]);
  const one = asked.value.value;
  if (!one) return asked.problem.value ? <Unknown name={name} problem={asked.problem.value} /> : <p class="quiet">Asking the gateway…</p>;
  return (
    <div data-function-page={one.name} class="fn-page">
      <Head one={one} asked={asked} />
      <Refusal text={asked.problem.value} />
      {one.state === "Failed" && <p class="refusal" role="alert">{one.reason || "It could not be made ready."}</p>}
      <Figures one={one} windowS={windowS} />
      <nav class="tabs" aria-label="Function">
        {TABS.map(([path, word]) => (
          <button key={path} type="button" aria-current={path === tab[0] ? "page" : undefined} onClick={() => setParam("tab", path)}>
            {word}{path === "dead" && one.stats.dead_letters > 0 && <small class="num fn-tab-count"> {integer(one.stats.dead_letters)}</small>}
          </button>
        ))}
      </nav>
      {tab[2]({ one, asked })}
    </div>
  );
}

function Head({ one, asked }: PartProps) {
  const deploying = useSignal(false);
  const question = useSignal<Question | null>(null);
  return (
    <header class="robot-head alert-head">
      <p class="crumb"><Link href="/functions">Functions</Link> /</p>
      <h1>{one.name}</h1>
      <Badge tone={stateTone(one.state)}>{stateWord(one.state)}</Badge>
      {one.description && <p class="fn-about">{one.description}</p>}
      {can("functions.write") && (
        <span class="fn-acts alert-go">
          <button type="button" class="button" onClick={() => (question.value = removal(one))}>Delete…</button>
          <button type="button" class="button button-solid" onClick={() => (deploying.value = true)}>Deploy…</button>
        </span>
      )}
      {deploying.value && <DeployDialog one={one} onClose={() => (deploying.value = false)} onDone={() => void asked.refresh()} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </header>
  );
}

const removal = (one: FunctionDetail): Question => ({
  title: `Delete ${one.name}?`,
  text: (
    <>
      <p>Its code, {one.versions} version{one.versions === 1 ? "" : "s"} and {one.aliases.length} alias{one.aliases.length === 1 ? "" : "es"} are gone for good.</p>
      {one.triggers.length > 0 && <p>What calls it goes on doing so: those events become dead letters.</p>}
    </>
  ),
  yes: "Delete it",
  run: async () => {
    await functionsApi.remove(one.name);
    go("/functions");
  },
});

function Figures({ one: { stats, concurrency }, windowS }: { one: FunctionDetail; windowS: number }) {
  const share = errorShare(stats);
  return (
    <div class="fn-figures">
      <dl>
        <Figure word="Calls" value={integer(stats.invocations)} note={stats.running > 0 ? `${stats.running} running` : ""} />
        <Figure word="Errors" value={integer(stats.errors)} note={share} bad={stats.errors > 0} />
        <Figure word="p50" value={milliseconds(stats.p50_ms)} />
        <Figure word="p95" value={milliseconds(stats.p95_ms)} note={stats.p99_ms === null ? "" : `p99 ${milliseconds(stats.p99_ms)}`} />
        <Figure word="Cold starts" value={integer(stats.cold_starts)} note={concurrency.warm > 0 ? `${concurrency.warm} kept warm` : ""} />
        {stats.throttles > 0 && <Figure word="Throttled" value={integer(stats.throttles)} note={concurrency.reserved === null ? "" : `bound ${concurrency.reserved}`} />}
        {(stats.waiting > 0 || stats.dead_letters > 0) && <Figure word="Waiting" value={integer(stats.waiting)} note={stats.dead_letters > 0 ? `${integer(stats.dead_letters)} dead` : ""} />}
        {stats.iterator_age_s !== null && <Figure word="Behind" value={duration(stats.iterator_age_s)} note="its topics" />}
      </dl>
      <div class="segments" role="group" aria-label="Time">
        {Object.keys(WINDOWS).map((word) => (
          <button key={word} type="button" aria-pressed={windowS === WINDOWS[word]} onClick={() => setParam("span", word, USUAL_WINDOW)}>{word}</button>
        ))}
      </div>
    </div>
  );
}

const Figure = ({ word, value, note = "", bad = false }: { word: string; value: string; note?: string; bad?: boolean }) => (
  <div data-figure={word}>
    <dt>{word}</dt>
    <dd class={bad ? "num bad" : "num"}>{value}<small>{note}</small></dd>
  </div>
);

function Unknown({ name, problem }: { name: string; problem: string }) {
  return (
    <section class="empty">
      <h1>{name}</h1>
      <Refusal text={problem} />
      <p><Link href={functionHref("").slice(0, -1)}>All functions</Link></p>
    </section>
  );
}
