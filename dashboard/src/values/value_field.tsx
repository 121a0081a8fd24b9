/** One typed value to fill in: a switch, a list of words, a number with its range, a text, a list. */

import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { same, type Json } from "./json";
import { BLANK, isList, KIND_WORDS, kindOf, parsed, rangeWords, textOf, type Field, type Kind } from "./values";

export interface ValueFieldProps {
  label: string;
  field: Exclude<Field, { type: "parameters" }>;
  value: Json | undefined;
  /** Undefined: what is typed is no value of that kind. */
  onChange: (value: Json | undefined) => void;
  hint?: string;
  disabled?: boolean;
  hideLabel?: boolean;
}

export function ValueField(props: ValueFieldProps) {
  const { field, value, label, onChange, disabled } = props;
  const id = useId();
  if (field.type === "choice") {
    return (
      <Framed {...props} id={id}>
        <select id={id} class="text" disabled={disabled} value={typeof value === "string" ? value : ""} onChange={(event) => onChange(event.currentTarget.value)}>
          {!field.words.includes(String(value)) && <option value="">choose…</option>}
          {field.words.map((word) => <option key={word} value={word}>{word}</option>)}
        </select>
      </Framed>
    );
  }
  if (field.type === "any") return <AnyField {...props} />;
  if (field.kind === "bool") {
    return (
      <Framed {...props} id={id}>
        <label class="switch">
          <input id={id} type="checkbox" role="switch" disabled={disabled} checked={value === true} aria-label={label} onChange={(event) => onChange(event.currentTarget.checked)} />
          <span class="mono">{value === true ? "true" : "false"}</span>
        </label>
      </Framed>
    );
  }
  return <Typed {...props} key={field.kind} id={id} kind={field.kind} limits={field.limits} />;
}

type TypedProps = ValueFieldProps & { id: string; kind: Kind; limits: { range?: { from: number; to: number; step: number } | null } };

/** Keeps what is typed, also while it is no value yet. */
function Typed(props: TypedProps) {
  const { kind, limits, value, onChange, disabled, id } = props;
  const typed = useSignal(textOf(value));
  const last = useRef<Json | undefined>(value);
  useEffect(() => {
    if (same(value, last.current)) return;
    last.current = value; // somebody else changed it
    typed.value = textOf(value);
  }, [value]);
  const found = parsed(kind, typed.value, limits);
  const problem = "problem" in found ? found.problem : "";
  const onInput = (text: string) => {
    typed.value = text;
    const now = parsed(kind, text, limits);
    last.current = "value" in now ? now.value : undefined;
    onChange(last.current);
  };
  const common = {
    id,
    class: "text mono",
    disabled,
    spellcheck: false,
    autoCapitalize: "none",
    "aria-invalid": problem !== "",
    "aria-describedby": `${id}-hint`,
    value: typed.value,
  } as const;
  const long = kind === "string_array" || (isList(kind) && typed.value.length > 60) || (kind === "string" && typed.value.length > 120);
  const hint = problem || [props.hint, isList(kind) && (kind === "string_array" ? "one each line" : "with commas between"), rangeWords(limits)].filter(Boolean).join(" · ");
  const numeric = kind === "integer" || kind === "double";
  return (
    <Framed {...props} hint={hint} problem={problem !== ""}>
      {long ? (
        <textarea {...common} rows={Math.min(8, Math.max(2, typed.value.split("\n").length))} onInput={(event) => onInput(event.currentTarget.value)} />
      ) : (
        <input {...common} autoComplete="off" inputMode={numeric ? (kind === "integer" ? "numeric" : "decimal") : undefined} onInput={(event) => onInput(event.currentTarget.value)} />
      )}
    </Framed>
  );
}

const KINDS: readonly Kind[] = ["bool", "integer", "double", "string", "bool_array", "integer_array", "double_array", "string_array"];

/** A value whose kind is chosen too. */
function AnyField(props: ValueFieldProps) {
  const { value = "", label, disabled, onChange } = props;
  const chosen = useSignal<Kind>(kindOf(value));
  const kind = chosen.value;
  return (
    <div class="any-field">
      <span class="any-name mono">{label}</span>
      <select
        class="text"
        aria-label={`Kind of ${label}`}
        disabled={disabled}
        value={kind}
        onChange={(event) => {
          chosen.value = event.currentTarget.value as Kind;
          const kept = parsed(chosen.value, textOf(value)); // what still fits the new kind stays
          onChange("value" in kept && textOf(value) !== "" ? kept.value : BLANK[chosen.value]);
        }}
      >
        {KINDS.map((one) => <option key={one} value={one}>{KIND_WORDS[one]}</option>)}
      </select>
      <ValueField {...props} hideLabel value={value} field={{ type: "value", kind, limits: {} }} />
    </div>
  );
}

function Framed(props: ValueFieldProps & { id: string; problem?: boolean; children: ComponentChildren }) {
  const { id, label, hint, problem = false, hideLabel = false, children } = props;
  return (
    <div class="field value-field">
      <span class={hideLabel ? "visually-hidden" : undefined}><label for={id}>{label}</label></span>
      {children}
      <small id={`${id}-hint`} class={problem ? "bad" : undefined}>{hint}</small>
    </div>
  );
}
