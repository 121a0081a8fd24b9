/** Calls a function with an event that one writes: its answer, how long it took, what it printed. */

import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Refusal, useAttempt } from "../admin/modal";
import { functionsApi, type Invoked } from "../api/functions";
import { can } from "../api/session";
import { robots } from "../live/fleet";
import { MayNot } from "../ui/parts";
import type { PartProps } from "./part_props";
import { likely, TEMPLATES, templateText } from "./templates";
import { LATEST, milliseconds } from "./words";

/** What is typed outlives a look at another tab. */
const drafts = new Map<string, string>();

export function TestCallPart({ one, asked }: PartProps) {
  const robot = robots.value?.[0]?.id ?? "sim_1";
  const text = useSignal(drafts.get(one.name) ?? templateText(likely(one), robot, new Date()));
  const qualifier = useSignal("");
  const answer = useSignal<Invoked | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const wrong = jsonProblem(text.value);
  const set = (typed: string) => {
    text.value = typed;
    drafts.set(one.name, typed);
  };
  const run = (kind: "request" | "event") =>
    void attempt(async () => {
      answer.value = null;
      answer.value = await functionsApi.invoke(one.name, text.value.trim() || "null", qualifier.value, kind);
      await asked.refresh();
    });
  if (!can("functions.invoke")) return <MayNot what="call functions" />;
  return (
    <div class="fn-test">
      <section class="card fn-event" aria-label="Event">
        <header>
          <h2>Event</h2>
          <select class="note-end" aria-label="Example" value="" onChange={(event) => event.currentTarget.value && set(templateText(event.currentTarget.value, robot, new Date()))}>
            <option value="">Example…</option>
            {Object.entries(TEMPLATES).map(([name, { word }]) => <option key={name} value={name}>{word}</option>)}
          </select>
        </header>
        <textarea class="text mono fn-json" aria-label="Event as JSON" spellcheck={false} autoCapitalize="none" aria-invalid={wrong !== ""} value={text.value} onInput={(event) => set(event.currentTarget.value)} onKeyDown={(event) => {
          if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && !wrong) run("request");
        }} />
        <div class="fn-run">
          <select aria-label="Version" value={qualifier.value} onChange={(event) => (qualifier.value = event.currentTarget.value)}>
            <option value="">{LATEST}</option>
            {one.aliases.map(({ name }) => <option key={name} value={name}>{name}</option>)}
            {[...one.published].reverse().map(({ version }) => <option key={version} value={version}>version {version}</option>)}
          </select>
          <small class={wrong ? "bad" : ""} role={wrong ? "alert" : undefined}>{wrong || <><kbd>Ctrl</kbd> <kbd>Enter</kbd></>}</small>
          <button type="button" class="button" disabled={busy.value || wrong !== ""} onClick={() => run("event")} title="Accepted now, called a moment later, tried again where it fails">As an event</button>
          <button type="button" class="button button-solid" disabled={busy.value || wrong !== ""} onClick={() => run("request")}>{busy.value ? "Running…" : "Call it"}</button>
        </div>
      </section>
      <section class="card fn-answer" aria-label="Answer" aria-busy={busy.value}>
        <header>
          <h2>Answer</h2>
          {answer.value && <AnswerFacts answer={answer.value} />}
        </header>
        <Refusal text={problem.value} />
        {answer.value ? <Answer answer={answer.value} /> : !problem.value && <p class="hint pad-in">{busy.value ? "It runs…" : "What it returns and what it prints stand here. A test is a real call: what the function does it does."}</p>}
      </section>
    </div>
  );
}

function AnswerFacts({ answer }: { answer: Invoked }) {
  const { status, duration_ms: took = 0, init_ms: init = 0, max_memory_mb: memory = 0, version } = answer;
  if (status === "accepted") return <Badge tone="good">accepted</Badge>;
  return (
    <>
      <span data-answer={status}><Badge tone={status === "ok" ? "good" : "bad"}>{status}</Badge></span>
      <span class="note num">{milliseconds(took)}{init > 0 && `, cold start ${milliseconds(init)}`}{memory > 0 && `, ${memory}\u202fMB`}{version && `, ${version === LATEST ? version : `version ${version}`}`}</span>
    </>
  );
}

function Answer({ answer }: { answer: Invoked }) {
  if (answer.status === "accepted") return <p class="hint pad-in">It will be called in a moment, and again where it fails. Its request <code>{answer.request_id}</code> stands under Invocations then.</p>;
  const { payload } = answer;
  return (
    <>
      <pre class="fn-out" data-failed={answer.status !== "ok"}>{typeof payload === "string" && answer.status !== "ok" ? payload : JSON.stringify(payload ?? null, null, 2)}</pre>
      <h3 class="fn-out-head">Log</h3>
      <pre class="fn-log">{answer.log?.trimEnd() || "It printed nothing."}</pre>
    </>
  );
}

function jsonProblem(text: string): string {
  if (!text.trim()) return "";
  try {
    JSON.parse(text);
    return "";
  } catch (error) {
    return error instanceof Error ? `No JSON: ${error.message.replace(/^JSON\.parse: /, "")}` : "No JSON.";
  }
}
