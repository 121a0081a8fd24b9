/** Making or changing a template: which robots, what they become, tried on all of them before it is stored. */

import { useSignal } from "@preact/signals";
import { useEffect, useId, useRef } from "preact/hooks";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import { Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { templatesApi, type Template, type TemplateChange } from "../api/templates";
import { twinApi } from "../api/twin";
import { documentOf, textOfDocument } from "../twin/draft";
import { Plan } from "../twin/review";
import { sectionsOf } from "../twin/schema";
import { TwinForm } from "../twin/twin_form";
import { writeJson, type JsonObject } from "../values/json";
import { SelectorField } from "./selector_field";
import { robotsText } from "./words";

const SCHEMA_MS = 600_000; // it changes with the gateway's version alone
export const WINDOWS: readonly [number, string][] = [
  [15, "15 s"],
  [60, "1 min"],
  [300, "5 min"],
  [1800, "30 min"],
];
export const USUAL_WINDOW_S = 60;

interface EditorProps {
  /** Null: a new one. */
  like: Template | null;
  taken: string[];
  onCancel: () => void;
  onDone: () => Promise<void>;
}

export function TemplateEditor({ like, taken, onCancel, onDone }: EditorProps) {
  const name = useSignal(like?.name ?? "");
  const selector = useSignal(like?.selector ?? "");
  const priority = useSignal(String(like?.priority ?? 0));
  const document = useSignal<JsonObject>(like?.document ?? {});
  const text = useSignal<string | null>(null);
  const invalid = useSignal<ReadonlySet<string>>(new Set());
  const reason = useSignal("");
  const windowS = useSignal(USUAL_WINDOW_S);
  const tried = useSignal<{ for: string; made: TemplateChange } | null>(null);
  const heading = useRef<HTMLHeadingElement>(null);
  const { busy, problem, attempt } = useAttempt();
  useEffect(() => heading.current?.focus(), []);

  const read = text.value === null ? { document: document.value } : documentOf(text.value);
  const body = { selector: selector.value.trim(), priority: Number(priority.value), document: "document" in read ? read.document : {} };
  const stamp = writeJson([name.value, body]);
  const made = tried.value?.for === stamp ? tried.value.made : null; // a plan counts for what it was made for
  const blocked = whyBlocked(name.value, priority.value, like, taken) || ("problem" in read ? read.problem : "") || (text.value === null && invalid.value.size > 0 ? `Not a value yet: ${[...invalid.value].join(", ")}` : "");
  useEffect(() => {
    problem.value = ""; // it was about another one
  }, [stamp]);

  const go = (dryRun: boolean) =>
    templatesApi.put(name.value.trim(), body, { dryRun, reason: reason.value.trim(), confirmWithinS: windowS.value, seen: like?.revision ?? 0 });
  const submit = async () => {
    if (made) {
      await go(false);
      await onDone();
    } else tried.value = { for: stamp, made: await go(true) };
  };
  return (
    <section class="card ops template-editor" aria-labelledby="template-title" data-card="template">
      <header><h2 id="template-title" tabIndex={-1} ref={heading}>{like ? `Edit ${like.name}` : "A new template"}</h2></header>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          if (!blocked) void attempt(submit);
        }}
      >
        <div class="template-fields">
          <TextField label="Name" mono required disabled={like !== null} placeholder="camera-rate" most={64} value={name.value} onInput={(typed) => (name.value = typed)} />
          <TextField label="Priority" note="the highest is laid last" value={priority.value} onInput={(typed) => (priority.value = typed)} />
        </div>
        <SelectorField value={selector.value} onInput={(typed) => (selector.value = typed)} />
        <DocumentField document={document} text={text} invalid={invalid} problem={"problem" in read ? read.problem : ""} />
        <div class="template-fields">
          <TextField label="Reason" note="for the history" most={200} value={reason.value} onInput={(typed) => (reason.value = typed)} />
          <SegmentedControl label="Goes back by itself after" choices={WINDOWS} chosen={windowS.value} onChoose={(seconds) => (windowS.value = seconds)} />
        </div>
        {made && <Plan shown={made.results} robots={Number(made.robots)} changed={made.results.filter(({ changed }) => changed)} windowS={windowS.value} />}
        <Refusal text={problem.value} />
        <div class="dialog-end">
          <span class="hint" role="status">{blocked}</span>
          <button type="button" class="button" onClick={onCancel}>Cancel</button>
          <button class="button button-solid" disabled={busy.value || blocked !== ""}>{made ? applyWord(Number(made.changed)) : "Show what would change"}</button>
        </div>
      </form>
    </section>
  );
}

const applyWord = (changed: number) => (changed === 0 ? "Store it: no robot changes" : `Apply to ${robotsText(changed)}`);

function whyBlocked(name: string, priority: string, like: Template | null, taken: string[]): string {
  if (!name.trim()) return "Give it a name.";
  if (like === null && taken.includes(name.trim())) return "There is a template of that name.";
  return /^-?\d{1,4}$/.test(priority.trim()) ? "" : "The priority is a number from -1000 to 1000.";
}

interface DocumentProps {
  document: { value: JsonObject };
  text: { value: string | null };
  invalid: { value: ReadonlySet<string> };
  problem: string;
}

/** The document as a form or as JSON, as on the Config tab. */
function DocumentField({ document, text, invalid, problem }: DocumentProps) {
  const id = useId();
  const schema = useAsked(twinApi.schema, SCHEMA_MS);
  const asForm = () => {
    const found = documentOf(text.value ?? "");
    if (!("document" in found)) return;
    document.value = found.document;
    invalid.value = new Set();
    text.value = null;
  };
  const note = (path: string, bad: boolean) => {
    const next = new Set(invalid.value);
    if (bad) next.add(path);
    else next.delete(path);
    invalid.value = next;
  };
  return (
    <div class="template-document">
      <div class="segments" role="group" aria-label="Edit as">
        <button type="button" aria-pressed={text.value === null} disabled={text.value !== null && problem !== ""} onClick={() => text.value !== null && asForm()}>Form</button>
        <button type="button" aria-pressed={text.value !== null} disabled={invalid.value.size > 0} onClick={() => (text.value ??= textOfDocument(document.value))}>JSON</button>
      </div>
      <Refusal text={schema.problem.value} />
      {text.value !== null ? (
        <div class="field">
          <label class="visually-hidden" for={id}>The template's document</label>
          <textarea id={id} class="text mono json" rows={Math.min(30, Math.max(8, text.value.split("\n").length + 1))} spellcheck={false} autoCapitalize="none" aria-invalid={problem !== ""} value={text.value} onInput={(event) => (text.value = event.currentTarget.value)} />
        </div>
      ) : schema.value.value === null ? <p class="hint">Asking the gateway for the form…</p> : (
        <TwinForm sections={sectionsOf(schema.value.value)} draft={document.value} given={{}} onChange={(changed) => (document.value = changed)} onInvalid={(path, bad) => note(path.join("."), bad)} />
      )}
    </div>
  );
}
