/** What a person does about an alert: see to it, give it to somebody, silence it, call it normal, end it. */

import { useSignal, type Signal } from "@preact/signals";
import { Confirm, Refusal, useAttempt, type Question } from "../admin/modal";
import { alertsApi, type Alert } from "../api/alerts";
import { can } from "../api/session";
import { MayNot } from "../ui/parts";
import { lazy } from "../views/lazy";
import { isOver } from "./words";

const AssignDialog = lazy(async () => (await import("./dialogs")).AssignDialog, null);
const SilenceDialog = lazy(async () => (await import("./dialogs")).SilenceDialog, null);
const NormalDialog = lazy(async () => (await import("./dialogs")).NormalDialog, null);

interface Props {
  one: Alert;
  refresh: () => Promise<void>;
}

const QUICK: readonly (readonly [number, string])[] = [[3600, "1 h"], [28_800, "8 h"]];

export function ActionsCard({ one, refresh }: Props) {
  const taught = useSignal<string[] | null>(null);
  return (
    <section class="card card-acts" aria-label="What to do">
      <header><h2>What to do</h2></header>
      <div class="alert-acts">
        {can("alerts.handle") ? <Acts one={one} refresh={refresh} taught={taught} /> : <MayNot what="handle alerts" />}
        {taught.value && <Taught lines={taught.value} />}
      </div>
    </section>
  );
}

function Acts({ one, refresh, taught }: Props & { taught: Signal<string[] | null> }) {
  const question = useSignal<Question | null>(null);
  const dialog = useSignal<"" | "assign" | "silence" | "normal">("");
  const { busy, problem, attempt } = useAttempt();
  const done = (work: () => Promise<unknown>) =>
    attempt(async () => {
      await work();
      await refresh();
    });
  const close = () => (dialog.value = "");
  const over = isOver(one);
  return (
    <>
      {!over && (
        <p class="act-row">
          {one.state === "open" ? (
            <button type="button" class="button button-solid" disabled={busy.value} onClick={() => void done(() => alertsApi.acknowledge(one.id))}>Acknowledge</button>
          ) : (
            <button type="button" class="button" disabled={busy.value} onClick={() => void done(() => alertsApi.unacknowledge(one.id))}>Unacknowledge</button>
          )}
          <button type="button" class="button" onClick={() => (question.value = resolveQuestion(one, refresh))}>Resolve…</button>
          <button type="button" class="button" onClick={() => (dialog.value = "assign")}>{one.assignee ? "Reassign…" : "Assign…"}</button>
        </p>
      )}
      <p class="act-row">
        <span class="act-name">Silence</span>
        {QUICK.map(([seconds, word]) => (
          <button key={seconds} type="button" class="button" disabled={busy.value} aria-label={`Silence for ${word}`} onClick={() => void done(() => alertsApi.silence(one.id, seconds, ""))}>{word}</button>
        ))}
        <button type="button" class="button" aria-label="Silence for another time" onClick={() => (dialog.value = "silence")}>…</button>
      </p>
      <p class="act-row">
        <button type="button" class="button" onClick={() => (dialog.value = "normal")}>This is normal…</button>
        <small>teaches the gateway</small>
      </p>
      <Refusal text={problem.value} />
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
      {dialog.value === "assign" && <AssignDialog one={one} refresh={refresh} onClose={close} />}
      {dialog.value === "silence" && <SilenceDialog one={one} refresh={refresh} onClose={close} />}
      {dialog.value === "normal" && <NormalDialog one={one} refresh={refresh} onTaught={(lines) => (taught.value = lines)} onClose={close} />}
    </>
  );
}

const resolveQuestion = (one: Alert, done: () => Promise<void>): Question => ({
  title: "Resolve this alert?",
  text: <p>It ends now. What begins again, or gets worse, comes back by itself.</p>,
  yes: "Resolve",
  reason: "What was it (for whoever meets it next)",
  run: async (text) => {
    await alertsApi.resolve(one.id, text);
    await done();
  },
});

function Taught({ lines }: { lines: string[] }) {
  return (
    <div class="taught" role="status" data-taught={lines.length}>
      <b>{lines.length > 0 ? "The gateway learned:" : "There was nothing that could be taught."}</b>
      {lines.length > 0 && <ul>{lines.map((line) => <li key={line} class="wrap">{line}</li>)}</ul>}
    </div>
  );
}
