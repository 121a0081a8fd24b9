/** A twin's document as a form: sections, their rows, and of each row the keys that it has; the rest can be added. */

import { useSignal } from "@preact/signals";
import { useId } from "preact/hooks";
import { can } from "../api/session";
import { isObject, type Json } from "../values/json";
import { shown } from "../values/value_text";
import { ValueField } from "../values/value_field";
import { BLANK, parsed } from "../values/values";
import { SECTIONS } from "./compare";
import { at, put, type Path } from "./document";
import type { FormProps } from "./form_props";
import { ParameterRows } from "./parameter_rows";
import type { KeySpec, SectionSpec } from "./schema";

/** What a node runs is an admin's to say. */
const CODE_KEYS: ReadonlySet<string> = new Set(["bundle", "version", "allowed", "command", "args"]);

export function TwinForm({ sections, ...form }: FormProps & { sections: readonly SectionSpec[] }) {
  return (
    <div class="twin-form">
      {sections.map((spec) => <Section key={spec.section} spec={spec} {...form} />)}
    </div>
  );
}

function Section({ spec, ...form }: FormProps & { spec: SectionSpec }) {
  const { draft } = form;
  const { section, name } = spec;
  const own = at(draft, [section]);
  const given = at(form.given, [section]);
  const rows = name === null ? [] : [...new Set([...Object.keys(isObject(own) ? own : {}), ...Object.keys(isObject(given) ? given : {})])].sort();
  const used = name === null ? own !== undefined : rows.length > 0;
  return (
    <details class="form-section" open={used} data-section={section}>
      <summary><h3>{SECTIONS[section] ?? section}</h3> <span class="hint">{spec.meaning}</span> {rows.length > 0 && <small class="num">{rows.length}</small>}</summary>
      {name === null ? <Keys spec={spec} path={[section]} {...form} /> : rows.map((row) => <Row key={row} spec={spec} row={row} {...form} />)}
      {name !== null && (section !== "nodes" || can("nodes.code")) && <AddRow spec={spec} taken={rows} onAdd={(row) => form.onChange(put(draft, [section, row], firstOf(spec)))} />}
    </details>
  );
}

/** What a new row holds before anything is filled in. */
function firstOf({ section, row }: SectionSpec): Json {
  if (row?.type === "choice") return row.words.includes("active") ? "active" : (row.words[0] ?? "");
  return section === "nodes" ? { allowed: "" } : {};
}

function Row({ spec, row, ...form }: FormProps & { spec: SectionSpec; row: string }) {
  const { draft, onChange } = form;
  const path = [spec.section, row];
  const own = at(draft, path);
  const { row: field } = spec;
  return (
    <section class="form-row" aria-label={row} data-row={row}>
      <header>
        <h4 class="mono">{row}</h4>
        {own === undefined ? <span class="from-template">template</span> : own === null && <span class="chip">taken away here</span>}
        <span class="form-acts">
          {own !== null && <button type="button" class="button" title={at(form.given, path) === undefined ? "The robot does without it" : "The robot does without it, whatever templates say"} aria-label={`Take ${row} away`} onClick={() => onChange(put(draft, path, at(form.given, path) === undefined ? undefined : null))}>Take away</button>}
          {own === null && <button type="button" class="button" onClick={() => onChange(put(draft, path, undefined))}>As before</button>}
        </span>
      </header>
      {own !== null && (field?.type === "choice" ? (
        <ValueField label={row} hideLabel field={field} value={own ?? at(form.given, path)} onChange={(value) => onChange(put(draft, path, value))} />
      ) : field?.type === "parameters" ? (
        <ParameterRows path={path} {...form} />
      ) : (
        <Keys spec={spec} path={path} {...form} />
      ))}
    </section>
  );
}

/** The keys that are set here, those that come from templates, and a list of what else there is. */
function Keys({ spec, path, ...form }: FormProps & { spec: SectionSpec; path: Path }) {
  const { draft, onChange, onInvalid } = form;
  const id = useId();
  const all = spec.keys ?? [];
  const set = all.filter(({ key }) => at(draft, [...path, key]) !== undefined);
  const templated = all.filter(({ key }) => at(draft, [...path, key]) === undefined && at(form.given, [...path, key]) !== undefined);
  const rest = all.filter((one) => !set.includes(one) && !templated.includes(one));
  const locked = (key: string) => (CODE_KEYS.has(key) && spec.section === "nodes") || spec.section === "agent" ? !can("nodes.code") : false;
  const start = (one: KeySpec) => onChange(put(draft, [...path, one.key], at(form.given, [...path, one.key]) ?? one.fallback ?? firstValue(one)));
  return (
    <>
      <div class="form-keys">
        {set.map((one) => {
          const here = [...path, one.key];
          const value = at(draft, here);
          return (
            <div key={one.key} class="form-key" data-field={here.join(".")}>
              {value === null ? <p class="hint"><span class="mono">{one.key}</span>: what templates say is taken away</p> : one.field.type === "parameters" ? (
                <fieldset class="form-parameters"><legend>{one.key} <small>{one.meaning}</small></legend><ParameterRows path={here} {...form} /></fieldset>
              ) : (
                <ValueField
                  label={one.key}
                  hint={locked(one.key) ? "What runs on a robot is an admin's to say." : one.meaning}
                  disabled={locked(one.key)}
                  field={one.field}
                  value={value}
                  onChange={(next) => {
                    onInvalid(here, next === undefined);
                    if (next !== undefined) onChange(put(draft, here, next));
                  }}
                />
              )}
              <button type="button" class="unset" aria-label={`Unset ${one.key}`} title="Leave it to templates and defaults" disabled={locked(one.key)} onClick={() => { onInvalid(here, false); onChange(put(draft, here, undefined)); }}>×</button>
            </div>
          );
        })}
      </div>
      <div class="form-more">
        {templated.map((one) => (
          <button key={one.key} type="button" class="chip chip-given" title={`${one.meaning}; from a template. Set it here instead`} disabled={locked(one.key)} onClick={() => start(one)}>
            {one.key}: {shown(at(form.given, [...path, one.key]))} <span class="from-template">template</span>
          </button>
        ))}
        {rest.length > 0 && (
          <>
            <label class="visually-hidden" for={id}>Set another key of {path.join(" ")}</label>
            <select id={id} class="text add-key" value="" onChange={(event) => { const one = rest.find(({ key }) => key === event.currentTarget.value); if (one) start(one); }}>
              <option value="">+ set…</option>
              {rest.map((one) => <option key={one.key} value={one.key} disabled={locked(one.key)}>{one.key} – {one.meaning}</option>)}
            </select>
          </>
        )}
      </div>
    </>
  );
}

function firstValue({ field }: KeySpec): Json {
  if (field.type === "choice") return field.words[0] ?? "";
  if (field.type === "value") return BLANK[field.kind];
  return field.type === "parameters" ? {} : "";
}

function AddRow({ spec, taken, onAdd }: { spec: SectionSpec; taken: string[]; onAdd: (name: string) => void }) {
  const name = useSignal("");
  const tried = useSignal(false);
  const id = useId();
  const { pattern = "", most = 256 } = spec.name ?? {};
  const found = parsed("string", name.value, { pattern, most, least: 1 });
  const problem = taken.includes(name.value) ? "it is there already" : "problem" in found ? found.problem : "";
  return (
    <form
      class="add-row"
      onSubmit={(event) => {
        event.preventDefault();
        tried.value = true;
        if (problem) return;
        onAdd(name.value);
        name.value = "";
        tried.value = false;
      }}
    >
      <label class="visually-hidden" for={id}>{NAMES[spec.section] ?? "Name"}</label>
      <input id={id} class="text mono" placeholder={NAMES[spec.section] ?? "name"} autoComplete="off" spellcheck={false} autoCapitalize="none" aria-invalid={tried.value && problem !== ""} value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
      <button class="button">Add</button>
      {tried.value && problem && <small class="bad" role="alert">{problem}</small>}
    </form>
  );
}

const NAMES: Record<string, string> = {
  topics: "topic or pattern, as camera/**",
  nodes: "name of a node",
  parameters: "node, as /lidar",
  lifecycle: "node, as /lidar",
};
