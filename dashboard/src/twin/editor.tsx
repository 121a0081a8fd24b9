/** Edit the robot's own document: as a form or as JSON; then look at what would change and where, and apply it. */

import type { Signal } from "@preact/signals";
import { useEffect, useId, useRef } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { twinApi, type Twin } from "../api/twin";
import { given, rebased, type Path } from "./document";
import { begun, documentOf, drafted, draftProblem, textOfDocument, type Draft } from "./draft";
import { Review } from "./review";
import { sectionsOf } from "./schema";
import { TwinForm } from "./twin_form";

const SCHEMA_MS = 600_000; // it changes with the gateway's version alone

interface EditorProps {
  twin: Twin;
  draft: Signal<Draft | null>;
  onApplied: () => Promise<void>;
}

export function Editor({ twin, draft, onApplied }: EditorProps) {
  const schema = useAsked(twinApi.schema, SCHEMA_MS);
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => heading.current?.focus(), []);
  const current = draft.value!;
  const change = (part: Partial<Draft>) => (draft.value = { ...current, ...part });
  const asForm = () => {
    const found = current.text === null ? null : documentOf(current.text);
    if (found && "document" in found) change({ document: found.document, text: null, invalid: new Set() });
  };
  const onInvalid = (path: Path, invalid: boolean) => {
    const next = new Set(draft.value!.invalid);
    if (invalid) next.add(path.join("."));
    else next.delete(path.join("."));
    draft.value = { ...draft.value!, invalid: next };
  };
  const moved = twin.edition !== current.edition;
  const carryOver = () => (draft.value = { ...begun(twin), document: rebased(current.base, drafted(current), twin.own) });
  const problem = draftProblem(current);
  return (
    <section class="card card-editor" aria-labelledby="editor-title" data-card="editor">
      <header>
        <h2 id="editor-title" tabIndex={-1} ref={heading}>Edit what is desired</h2>
        <span class="segments note-end" role="group" aria-label="Edit as">
          <button type="button" aria-pressed={current.text === null} disabled={current.text !== null && problem !== ""} onClick={asForm}>Form</button>
          <button type="button" aria-pressed={current.text !== null} disabled={current.invalid.size > 0} onClick={() => current.text === null && change({ text: textOfDocument(current.document) })}>JSON</button>
        </span>
      </header>
      <p class="hint pad-in">
        This is the robot's <b>own</b> document. It lies over the templates that name the robot; what it does not say is left to them, then to the robot's own settings.
      </p>
      {moved && (
        <p class="moved" role="alert">
          Somebody changed it meanwhile: it is at revision {twin.revision} now. <button type="button" class="button" onClick={carryOver}>Carry my changes over to it</button>
        </p>
      )}
      <div class="editor-body">
        <Refusal text={schema.problem.value} />
        {current.text !== null ? (
          <JsonField text={current.text} problem={problem} onInput={(text) => change({ text })} />
        ) : schema.value.value === null ? (
          <p class="hint">Asking the gateway for the form…</p>
        ) : (
          <TwinForm
            sections={sectionsOf(schema.value.value)}
            draft={current.document}
            given={given(twin.desired, current.base)}
            onChange={(document) => (draft.value = { ...draft.value!, document })}
            onInvalid={onInvalid}
          />
        )}
      </div>
      <Review twin={twin} draft={current} moved={moved} onCancel={() => (draft.value = null)} onApplied={onApplied} />
    </section>
  );
}

function JsonField({ text, problem, onInput }: { text: string; problem: string; onInput: (text: string) => void }) {
  const id = useId();
  return (
    <div class="field">
      <span><label for={id}>The robot's own document</label> <small>null in it takes away what templates say</small></span>
      <textarea
        id={id}
        class="text mono json"
        rows={Math.min(30, Math.max(10, text.split("\n").length + 1))}
        spellcheck={false}
        autoCapitalize="none"
        aria-invalid={problem !== ""}
        aria-describedby={`${id}-hint`}
        value={text}
        onInput={(event) => onInput(event.currentTarget.value)}
      />
      <small id={`${id}-hint`} class={problem ? "bad" : undefined}>{problem || "JSON; a number with a point stays one: 10.0 and 10 are two kinds of ROS parameter."}</small>
    </div>
  );
}
