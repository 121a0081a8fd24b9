/** A message being written: as a form made from its type, or as JSON; both are the same draft. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect, useId } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { saidOf } from "../api/client";
import { introspectApi, type TypeShape } from "../api/introspect";
import { isObject, readJson, writeJson, type JsonObject } from "../values/json";
import { MessageFields } from "./message_form";
import { blankMessage } from "./shape";

export interface Draft {
  shape: Signal<TypeShape | null>;
  problem: Signal<string>;
  value: Signal<JsonObject>;
  invalid: Signal<ReadonlySet<string>>;
  /** Goes up when the fields are to show other values than those typed. */
  round: Signal<number>;
}

export type Part = "message" | "request" | "goal";

/** The draft of one part of a type, empty until its shape is known. */
export function useDraft(robot: string, type: string, part: Part): Draft {
  const draft: Draft = {
    shape: useSignal<TypeShape | null>(null),
    problem: useSignal(""),
    value: useSignal<JsonObject>({}),
    invalid: useSignal<ReadonlySet<string>>(new Set()),
    round: useSignal(0),
  };
  useEffect(() => {
    let gone = false;
    draft.shape.value = null;
    draft.problem.value = "";
    introspectApi.shape(robot, type).then(
      (shape) => {
        if (gone) return;
        draft.value.value = blankMessage(shape, shape.parts[part] ?? "");
        draft.invalid.value = new Set();
        draft.shape.value = shape;
      },
      (error: unknown) => !gone && (draft.problem.value = saidOf(error)),
    );
    return () => (gone = true);
  }, [robot, type, part]);
  return draft;
}

/** Take other values than those typed. */
export function replaceDraft(draft: Draft, value: JsonObject): void {
  draft.value.value = value;
  draft.invalid.value = new Set();
  draft.round.value += 1;
}

export function DraftFields({ draft, part }: { draft: Draft; part: Part }) {
  const asText = useSignal(false);
  const shape = draft.shape.value;
  if (draft.problem.value) return <Refusal text={draft.problem.value} />;
  if (!shape) return <p class="hint">Reading what the type is made of…</p>;
  const name = shape.parts[part] ?? "";
  const mark = (path: string, bad: boolean) => {
    const before = draft.invalid.peek();
    if (path.endsWith(".*")) draft.invalid.value = new Set([...before].filter((one) => !one.startsWith(path.slice(0, -1))));
    else if (before.has(path) !== bad) draft.invalid.value = new Set(bad ? [...before, path] : [...before].filter((one) => one !== path));
  };
  return (
    <div class="draft">
      <div class="draft-head">
        <div class="segments" role="group" aria-label="How it is written">
          <button type="button" aria-pressed={!asText.value} disabled={asText.value && draft.invalid.value.size > 0} onClick={() => { if (asText.value) draft.round.value += 1; asText.value = false; }}>Form</button>
          <button type="button" aria-pressed={asText.value} onClick={() => { asText.value = true; draft.invalid.value = new Set(); }}>JSON</button>
        </div>
        <button type="button" class="button" onClick={() => replaceDraft(draft, blankMessage(shape, name))}>Clear</button>
      </div>
      {asText.value ? (
        <TextDraft key={draft.round.value} draft={draft} onInvalid={(bad) => mark("", bad)} />
      ) : (
        <MessageFields key={draft.round.value} shape={shape} name={name} value={draft.value.value} onChange={(value) => isObject(value) && (draft.value.value = value)} onInvalid={mark} />
      )}
    </div>
  );
}

function TextDraft({ draft, onInvalid }: { draft: Draft; onInvalid: (bad: boolean) => void }) {
  const id = useId();
  const text = useSignal(writeJson(draft.value.peek(), 2));
  const problem = useSignal("");
  const change = (typed: string) => {
    text.value = typed;
    try {
      const value = readJson(typed);
      if (!isObject(value)) throw new Error("a message is an object: { … }");
      problem.value = "";
      draft.value.value = value;
    } catch (error) {
      problem.value = saidOf(error);
    }
    onInvalid(problem.value !== "");
  };
  return (
    <div class="field">
      <label for={id} class="visually-hidden">As JSON</label>
      <textarea id={id} class="text mono" rows={Math.min(18, Math.max(5, text.value.split("\n").length))} autoCapitalize="none" spellcheck={false} aria-invalid={problem.value !== ""} value={text.value} onInput={(event) => change(event.currentTarget.value)} />
      <small class="bad" role="alert">{problem.value}</small>
    </div>
  );
}
