/** A part of a document as JSON: what is typed counts as soon as it can be read. Empty: nothing. */

import { useSignal } from "@preact/signals";
import { useEffect, useId } from "preact/hooks";
import { readJson, same, writeJson, type Json } from "../values/json";

interface JsonFieldProps {
  label: string;
  note?: string;
  value: Json;
  problem: string;
  onChange: (value: Json) => void;
}

const textOf = (value: Json) => (value === null ? "" : writeJson(value, 2));

function readOr(text: string): { value: Json } | null {
  try {
    return { value: text.trim() ? readJson(text) : null };
  } catch {
    return null;
  }
}

export function JsonField({ label, note, value, problem, onChange }: JsonFieldProps) {
  const id = useId();
  const text = useSignal(textOf(value));
  const found = readOr(text.value);
  useEffect(() => {
    const typed = readOr(text.peek());
    if (typed && !same(typed.value, value)) text.value = textOf(value); // it was changed elsewhere
  }, [value]);
  const wrong = found === null ? "is no JSON yet" : problem;
  return (
    <div class="field">
      <span><label for={id}>{label}</label> {note && <small>{note}</small>}</span>
      <textarea
        id={id}
        class="text fn-env rule-json"
        rows={Math.min(14, Math.max(2, text.value.split("\n").length))}
        spellcheck={false}
        autoCapitalize="none"
        aria-invalid={wrong !== ""}
        aria-describedby={wrong ? `${id}-hint` : undefined}
        value={text.value}
        onInput={(event) => {
          text.value = event.currentTarget.value;
          const typed = readOr(text.value);
          if (typed) onChange(typed.value);
        }}
      />
      {wrong && <small id={`${id}-hint`} class="bad" role="alert">{wrong}</small>}
    </div>
  );
}
