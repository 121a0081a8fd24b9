/** What a rule does: its targets, each with its own fields and what it is given of the event. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import { useAsked } from "../admin/use_list";
import { call } from "../api/call";
import type { RuleFault } from "../api/rules";
import { can } from "../api/session";
import { isObject, type Json, type JsonObject } from "../values/json";
import { faultAt, withPlace } from "./document";
import type { FormProps } from "./form_props";
import { JsonField } from "./json_field";
import { fieldsOf, fieldText, fieldValue, newTarget, TARGETS } from "./target_fields";

const EVERY_MS = 60_000;
/** Offered while one types: another may be deployed later. */
const names = async () => (can("functions.read") ? (await call("GET /functions", { query: { limit: 200 } })).functions.map(({ name }) => name) : []);

const WAYS: readonly (readonly [string, string])[] = [["", "the whole event"], ["input_path", "a part of it"], ["input", "something fixed"], ["transformer", "a template"]];
const START: Record<string, Json> = { input_path: "$.detail", input: {}, transformer: { paths: { robot: "$.detail.robot" }, template: { text: "<robot>" } } };

export function TargetsForm({ document, faults, onChange, kinds }: FormProps & { kinds: (readonly [string, string])[] }) {
  const targets = Array.isArray(document.targets) ? document.targets : [];
  const functions = useAsked(names, EVERY_MS).value.value ?? [];
  return (
    <fieldset class="rule-part">
      <legend>Then</legend>
      {targets.length === 0 && <p class="hint">It does nothing yet: it only counts how often it would fire.</p>}
      {targets.map((target, i) => isObject(target) && <TargetCard key={i} target={target} at={i} functions={functions} faults={faults} set={(place, value) => onChange(withPlace(document, ["targets", i, ...place], value))} onRemove={() => onChange(withPlace(document, ["targets", i], undefined))} />)}
      <select class="rule-add" aria-label="Add a target" value="" onChange={(event) => {
        const kind = event.currentTarget.value;
        event.currentTarget.value = "";
        if (kind) onChange(withPlace(document, ["targets", targets.length], newTarget(kind, targets)));
      }}>
        <option value="">+ Add what it does…</option>
        {kinds.map(([kind, word]) => <option key={kind} value={kind}>{word}</option>)}
      </select>
      {faults.some(({ path }) => path === "targets") && <p class="bad" role="alert">{faultAt(faults, "targets")}</p>}
    </fieldset>
  );
}

interface CardProps {
  target: JsonObject;
  at: number;
  functions: readonly string[];
  faults: readonly RuleFault[];
  set: (place: (string | number)[], value: Json | undefined) => void;
  onRemove: () => void;
}

function TargetCard({ target, at, functions, faults, set, onRemove }: CardProps) {
  const path = `targets[${at}]`;
  const way = WAYS.find(([key]) => key && target[key] !== undefined)?.[0] ?? "";
  const open = useSignal(way !== "");
  const turn = (chosen: string) => {
    const rest = Object.fromEntries(Object.entries(target).filter(([key]) => key !== way)) as JsonObject;
    set([], chosen ? { ...rest, [chosen]: START[chosen]! } : rest);
  };
  const whole = faults.find((fault) => fault.path === path)?.message;
  return (
    <section class="rule-target" data-target={fieldText(target.id)} aria-label={fieldText(target.id)}>
      <header>
        <b>{TARGETS[String(target.kind)]?.word ?? String(target.kind)}</b>
        <input class="text mono" aria-label="Its id" spellcheck={false} maxLength={63} value={fieldText(target.id)} aria-invalid={faultAt(faults, `${path}.id`) !== ""} onInput={(event) => set(["id"], event.currentTarget.value)} />
        <button type="button" class="button" aria-label={`Remove ${fieldText(target.id)}`} onClick={onRemove}>Remove</button>
      </header>
      {(whole ?? faultAt(faults, `${path}.id`)) && <p class="bad" role="alert">{whole ?? faultAt(faults, `${path}.id`)}</p>}
      <div class="check-fields">
        {fieldsOf(target).map(({ key, label, hint, placeholder, as, choices }) =>
          choices ? (
            <label key={key} class="field">
              <span>{label}</span>
              <select value={fieldText(target[key])} onChange={(event) => set([key], event.currentTarget.value)}>{choices.map((word) => <option key={word} value={word}>{word}</option>)}</select>
            </label>
          ) : (
            <TextField key={key} label={label} hint={hint} mono options={key === "function" && target.kind === "function" ? functions : undefined} placeholder={placeholder} value={fieldText(target[key])} problem={faultAt(faults, `${path}.${key}`)} onInput={(text) => set([key], fieldValue(text, as))} />
          ),
        )}
      </div>
      {!open.value ? <button type="button" class="button rule-more" onClick={() => (open.value = true)}>What it is given…</button> : (
        <>
          <label class="field">
            <span>It is given</span>
            <select value={way} onChange={(event) => turn(event.currentTarget.value)}>{WAYS.map(([key, word]) => <option key={key} value={key}>{word}</option>)}</select>
          </label>
          {way === "input_path" && <TextField label="Path" mono value={fieldText(target.input_path)} problem={faultAt(faults, `${path}.input_path`)} onInput={(text) => set(["input_path"], text)} />}
          {(way === "input" || way === "transformer") && <JsonField label={way === "input" ? "Input" : "Template"} note={way === "input" ? "" : "paths name values, <name> puts them in"} value={target[way] ?? null} problem={faultAt(faults, `${path}.${way}`)} onChange={(value) => set([way], value)} />}
        </>
      )}
    </section>
  );
}
