/** ROS parameters of a document by name, each with its kind: set, unset, added. */

import { useSignal } from "@preact/signals";
import { isObject } from "../values/json";
import { ValueField } from "../values/value_field";
import { at, put, type Path } from "./document";
import type { FormProps } from "./form_props";

const NAME = /^[A-Za-z_][A-Za-z0-9_.]{0,255}$/;

export function ParameterRows({ path, draft, given, onChange, onInvalid }: FormProps & { path: Path }) {
  const name = useSignal("");
  const own = at(draft, path);
  const templated = at(given, path);
  const names = [...new Set([...Object.keys(isObject(own) ? own : {}), ...Object.keys(isObject(templated) ? templated : {})])].sort();
  const add = () => {
    const typed = name.value.trim();
    if (!NAME.test(typed) || names.includes(typed)) return;
    onChange(put(draft, [...path, typed], ""));
    name.value = "";
  };
  return (
    <div class="parameter-rows">
      {names.map((one) => {
        const here = [...path, one];
        const mine = at(draft, here);
        if (mine === null) return <p key={one} class="hint"><span class="mono">{one}</span>: taken away here</p>;
        return (
          <div key={one} class="form-key" data-field={here.join(".")}>
            <ValueField
              label={one}
              field={{ type: "any" }}
              value={mine ?? at(given, here)}
              onChange={(value) => {
                onInvalid(here, value === undefined);
                if (value !== undefined) onChange(put(draft, here, value));
              }}
            />
            {mine === undefined ? <span class="from-template">template</span> : <button type="button" class="unset" aria-label={`Unset ${one}`} onClick={() => { onInvalid(here, false); onChange(put(draft, here, undefined)); }}>×</button>}
          </div>
        );
      })}
      <div class="add-row">
        <input class="text mono" aria-label="Name of a parameter" placeholder="name of a parameter" autoComplete="off" spellcheck={false} autoCapitalize="none" value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} onKeyDown={(event) => { if (event.key === "Enter") { event.preventDefault(); add(); } }} />
        <button type="button" class="button" disabled={!NAME.test(name.value.trim()) || names.includes(name.value.trim())} onClick={add}>Add</button>
      </div>
    </div>
  );
}
