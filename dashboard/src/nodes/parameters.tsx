/** A running node's ROS parameters as a typed form: what its descriptors say is kept, what it refuses is said there. */

import { useSignal } from "@preact/signals";
import { Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { nodesApi, type Node, type Parameter, type SetResult } from "../api/nodes";
import { can } from "../api/session";
import { isNumeric, same, type Json } from "../values/json";
import { shown } from "../values/value_text";
import { ValueField } from "../values/value_field";
import { KIND_WORDS, type Kind, type Range } from "../values/values";

const LOOK_MS = 10_000;

export function ParametersView({ node: { robot, name } }: { node: Node }) {
  const asked = useAsked(() => nodesApi.parameters(robot, name), LOOK_MS);
  const drafts = useSignal<Record<string, Json>>({});
  const invalid = useSignal<ReadonlySet<string>>(new Set());
  const refused = useSignal<Record<string, string>>({});
  const keep = useSignal(false);
  const round = useSignal(0);
  const { busy, problem, attempt } = useAttempt();
  const parameters = asked.value.value;
  if (!parameters) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="hint pad-in">Asking the node…</p>;
  const changed = parameters.filter(({ name: one, value }) => one in drafts.value && !same(drafts.value[one], value));
  const change = (one: string, value: Json | undefined) => {
    const bad = new Set(invalid.value);
    if (value === undefined) bad.add(one);
    else {
      bad.delete(one);
      drafts.value = { ...drafts.value, [one]: value };
    }
    invalid.value = bad;
    refused.value = Object.fromEntries(Object.entries(refused.value).filter(([key]) => key !== one));
  };
  const forget = () => {
    drafts.value = {};
    refused.value = {};
    invalid.value = new Set();
    round.value += 1; // fields show the node's values again
  };
  const save = () =>
    attempt(async () => {
      const results = await nodesApi.setParameters(robot, name, Object.fromEntries(changed.map((one) => [one.name, drafts.value[one.name]!])), keep.value);
      const bad = results.filter(({ successful }) => !successful);
      refused.value = Object.fromEntries(bad.map(({ name: one, reason }: SetResult) => [one, reason || "the node refused it"]));
      drafts.value = Object.fromEntries(Object.entries(drafts.value).filter(([one]) => bad.some((item) => item.name === one)));
      await asked.refresh();
    });
  if (parameters.length === 0) return <p class="hint pad-in">This node has no parameters.</p>;
  return (
    <form class="parameters" onSubmit={(event) => { event.preventDefault(); if (changed.length > 0 && invalid.value.size === 0) void save(); }}>
      <Refusal text={asked.problem.value} />
      <div class="parameter-list" key={round.value}>
        {parameters.map((one) => (
          <ParameterField key={one.name} parameter={one} value={drafts.value[one.name] ?? one.value} changed={changed.includes(one)} refused={refused.value[one.name] ?? ""} onChange={(value) => change(one.name, value)} />
        ))}
      </div>
      <Refusal text={problem.value} />
      {can("nodes.control") && (
        <div class="dialog-end parameters-end">
          <label class="check"><input type="checkbox" checked={keep.value} onChange={(event) => (keep.value = event.currentTarget.checked)} /> Keep: also after the node starts again</label>
          {changed.length > 0 && <button type="button" class="button" onClick={forget}>Undo</button>}
          <button class="button button-solid" disabled={busy.value || changed.length === 0 || invalid.value.size > 0}>
            {changed.length === 0 ? "Set" : `Set ${changed.length} ${changed.length === 1 ? "value" : "values"}`}
          </button>
        </div>
      )}
    </form>
  );
}

interface ParameterFieldProps {
  parameter: Parameter;
  value: Json;
  changed: boolean;
  refused: string;
  onChange: (value: Json | undefined) => void;
}

function ParameterField({ parameter, value, changed, refused, onChange }: ParameterFieldProps) {
  const { name, type, description, constraints, read_only: fixed, desired, dynamic_typing: dynamic } = parameter;
  const free = type === "not_set" || dynamic;
  const differs = desired !== undefined && !alike(desired, parameter.value);
  return (
    <div class={changed ? "parameter parameter-changed" : "parameter"} data-parameter={name} data-type={type}>
      <p class="parameter-name">
        <b class="mono wrap">{name}</b> <small>{type === "not_set" ? "not set" : KIND_WORDS[type]}</small>
        {fixed && <span class="chip">read-only</span>}
      </p>
      <div>
        <ValueField
          label={name}
          hideLabel
          disabled={fixed || !can("nodes.control")}
          hint={[description, constraints].filter(Boolean).join(" · ")}
          field={free ? { type: "any" } : { type: "value", kind: type as Kind, limits: { range: rangeOf(parameter), special: true } }}
          value={value ?? undefined}
          onChange={onChange}
        />
        {refused && <p class="bad parameter-said" role="alert">{refused}</p>}
        {differs && <p class="sub sub-why parameter-said">the twin wants {shown(desired)}</p>}
      </div>
    </div>
  );
}

const alike = (one: Json, other: Json) => same(one, other) || (isNumeric(one) && isNumeric(other) && Number(one) === Number(other));

function rangeOf({ integer_range: whole, floating_point_range: real }: Parameter): Range | null {
  const found = whole ?? real;
  return found && { from: Number(found.from), to: Number(found.to), step: Number(found.step) };
}
