/** A rule being edited: the form and its JSON beside each other, and what the gateway would refuse, at its place. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { saidOf } from "../api/client";
import { rulesApi, type RuleFault } from "../api/rules";
import type { JsonObject } from "../values/json";
import { lineOf, read, textOf } from "./document";
import { RuleForm } from "./form";

const TYPING_MS = 350;
/** A rule that has no name yet is looked at for the rest. */
const UNNAMED = "new";

/** What the gateway says of a document, a moment after it was last changed. Null: it was not asked yet. */
export function useFaults(document: JsonObject | null): { faults: Signal<RuleFault[] | null>; problem: Signal<string> } {
  const faults = useSignal<RuleFault[] | null>(null);
  const problem = useSignal("");
  const text = document ? textOf(document) : "";
  useEffect(() => {
    if (!document) return;
    let gone = false;
    const timer = setTimeout(() => {
      rulesApi.check(document.name === "" ? { ...document, name: UNNAMED } : document).then(
        (found) => {
          if (gone) return;
          faults.value = found;
          problem.value = "";
        },
        (error: unknown) => {
          if (!gone) problem.value = saidOf(error);
        },
      );
    }, TYPING_MS);
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [text]);
  return { faults, problem };
}

export function RuleEditor({ text, faults, isNew }: { text: Signal<string>; faults: readonly RuleFault[]; isNew: boolean }) {
  const { document, problem } = read(text.value);
  return (
    <div class="rule-editor">
      <section class="card" aria-label="Form">
        <header><h2>Form</h2></header>
        {document ? <RuleForm document={document} faults={faults} isNew={isNew} onChange={(changed) => (text.value = textOf(changed))} /> : <p class="hint pad-in">The JSON beside it cannot be read yet; the form is back as soon as it can.</p>}
      </section>
      <JsonCard text={text} document={document} problem={problem} faults={faults} />
    </div>
  );
}

function JsonCard({ text, document, problem, faults }: { text: Signal<string>; document: JsonObject | null; problem: string; faults: readonly RuleFault[] }) {
  const area = useRef<HTMLTextAreaElement>(null);
  const jump = (path: string) => {
    if (!document || !area.current) return;
    text.value = textOf(document); // so that its lines are those that are counted
    const line = lineOf(document, path);
    const lines = text.value.split("\n");
    const start = lines.slice(0, Math.max(0, line)).join("\n").length + (line > 0 ? 1 : 0);
    queueMicrotask(() => {
      area.current?.focus();
      area.current?.setSelectionRange(start, start + (lines[Math.max(0, line)]?.length ?? 0));
    });
  };
  return (
    <section class="card rule-document" aria-label="JSON">
      <header><h2>JSON</h2>{document && textOf(document) !== text.value && <button type="button" class="button note-end" onClick={() => (text.value = textOf(document))}>Tidy up</button>}</header>
      <textarea ref={area} class="text mono fn-json" aria-label="The rule as JSON" spellcheck={false} autoCapitalize="none" aria-invalid={problem !== "" || faults.length > 0} value={text.value} onInput={(event) => (text.value = event.currentTarget.value)} />
      <div class="rule-faults" role="status" data-faults={problem ? "json" : faults.length}>
        {problem ? <p class="bad">{problem}</p> : faults.length === 0 ? <p class="hint">The gateway takes it like this.</p> : faults.map(({ path, message }) => (
          <p key={path} class="bad"><button type="button" onClick={() => jump(path)}><code>{path || "the rule"}</code></button> {message}</p>
        ))}
      </div>
    </section>
  );
}
