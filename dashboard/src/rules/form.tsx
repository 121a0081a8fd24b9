/** A rule as a form: what it listens to, what has to hold, what it does. Whatever it does not show stays as it is. */

import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import type { Document } from "../api/rules";
import { isObject, numeric, type Json, type JsonObject } from "../values/json";
import { faultAt, withPlace, withSource } from "./document";
import type { FormProps } from "./form_props";
import { JsonField } from "./json_field";
import { ScheduleFields } from "./schedule_fields";
import { fieldText, fieldValue, TARGETS } from "./target_fields";
import { TargetsForm } from "./targets_form";
import { TYPES } from "./types";
import { SOURCES, sourceOf } from "./words";

const list = (value: Json | undefined) => (Array.isArray(value) ? value : []);

export function RuleForm({ document, faults, onChange, isNew }: FormProps & { isNew: boolean }) {
  const set = (place: (string | number)[], value: Json | undefined) => onChange(withPlace(document, place, value));
  const source = sourceOf(document as unknown as Document);
  return (
    <div class="rule-form">
      {isNew && <TextField label="Name" mono focus hint="a-z, 0-9, _ . -" most={63} value={fieldText(document.name)} problem={document.name ? faultAt(faults, "name") : ""} onInput={(text) => set(["name"], text)} />}
      <TextField label="Description" most={1000} value={fieldText(document.description)} problem={faultAt(faults, "description")} onInput={(text) => set(["description"], text || undefined)} />
      <fieldset class="rule-part">
        <legend>When</legend>
        <SegmentedControl label="Listens to" choices={SOURCES} chosen={source} onChoose={(chosen) => chosen !== source && onChange(withSource(document, chosen))} />
        {source === "pattern" && <PatternFields document={document} faults={faults} onChange={onChange} />}
        {source === "topic" && <TopicFields document={document} faults={faults} onChange={onChange} />}
        {source === "metric" && <MetricFields document={document} faults={faults} onChange={onChange} />}
        {source === "schedule" && <ScheduleFields document={document} faults={faults} onChange={onChange} />}
      </fieldset>
      {source !== "schedule" && <WhenFields document={document} faults={faults} onChange={onChange} />}
      <TargetsForm document={document} faults={faults} onChange={onChange} kinds={Object.entries(TARGETS).map(([kind, { word }]) => [kind, word] as const)} />
    </div>
  );
}

function PatternFields({ document, faults, onChange }: FormProps) {
  const pattern = isObject(document.pattern) ? document.pattern : {};
  const types = list(pattern["detail-type"]);
  const plain = types.every((one) => typeof one === "string");
  const chosen = types.filter((one): one is string => typeof one === "string");
  return (
    <>
      {plain && <TextField label="What happens" note="its type; several between spaces" mono options={TYPES} value={chosen.join(" ")} problem={faultAt(faults, "pattern.detail-type")} onInput={(text) => onChange(withPlace(document, ["pattern", "detail-type"], text.trim() ? text.split(/[\s,]+/).filter(Boolean) : undefined))} />}
      <JsonField label="Pattern" note="EventBridge's language" value={document.pattern ?? {}} problem={faultAt(faults, "pattern")} onChange={(value) => onChange(withPlace(document, ["pattern"], value))} />
    </>
  );
}

function Robots({ document, faults, onChange, at }: FormProps & { at: "topic" | "metric" }) {
  const source = document[at] as JsonObject;
  const robots = list(source.robots).map(String);
  return <TextField label="Robots" mono placeholder="every robot" value={robots.join(" ") === "*" ? "" : robots.join(" ")} problem={faultAt(faults, `${at}.robots`)} onInput={(text) => onChange(withPlace(document, [at, "robots"], fieldValue(text, "list") ?? ["*"]))} />;
}

function TopicFields({ document, faults, onChange }: FormProps) {
  const topic = document.topic as JsonObject;
  return (
    <>
      <div class="check-fields">
        <TextField label="Topic" mono value={fieldText(topic.topic)} problem={faultAt(faults, "topic.topic")} onInput={(text) => onChange(withPlace(document, ["topic", "topic"], text))} />
        <Robots document={document} faults={faults} onChange={onChange} at="topic" />
      </div>
      <JsonField label="Only messages like" note="a pattern over detail.message; empty: every one" value={document.pattern ?? null} problem={faultAt(faults, "pattern")} onChange={(value) => onChange(withPlace(document, ["pattern"], value ?? undefined))} />
    </>
  );
}

function MetricFields({ document, faults, onChange }: FormProps) {
  const metric = document.metric as JsonObject;
  const bound = (label: string, key: "above" | "below") => (
    <TextField label={label} mono value={fieldText(metric[key])} problem={faultAt(faults, `metric.${key}`)} onInput={(text) => onChange(withPlace(document, ["metric", key], text === "" ? undefined : (numeric(text) ?? text)))} />
  );
  return (
    <div class="check-fields">
      <TextField label="Number" mono value={fieldText(metric.series)} problem={faultAt(faults, "metric.series")} onInput={(text) => onChange(withPlace(document, ["metric", "series"], text))} />
      <Robots document={document} faults={faults} onChange={onChange} at="metric" />
      {bound("Above", "above")}
      {bound("Below", "below")}
    </div>
  );
}

const CONDITIONS: [string, string, string][] = [
  ["for", "Holds for", "10s"],
  ["absent_for", "Is absent for", "5m"],
  ["debounce", "Quiet again for", "2s"],
  ["cooldown", "Then not for", "10m"],
];

/** The four conditions that most rules need; the others (rate, hysteresis, edge, group_by) are written as JSON. */
function WhenFields({ document, faults, onChange }: FormProps) {
  const when = isObject(document.when) ? document.when : {};
  const set = (key: string, value: Json | undefined) => {
    const changed = withPlace(document, ["when", key], value);
    onChange(Object.keys(changed.when as JsonObject).length === 0 ? withPlace(changed, ["when"], undefined) : changed);
  };
  return (
    <fieldset class="rule-part">
      <legend>And only if</legend>
      <div class="rule-when">
        {CONDITIONS.map(([key, label, example]) => (
          <TextField key={key} label={label} mono placeholder={`– e.g. ${example}`} disabled={isObject(when[key])} value={isObject(when[key]) ? "see JSON" : fieldText(when[key])} problem={faultAt(faults, `when.${key}`)} onInput={(text) => set(key, text || undefined)} />
        ))}
      </div>
      <JsonField label="All conditions" note="also rate, hysteresis, edge, group_by" value={document.when ?? null} problem={faultAt(faults, "when")} onChange={(value) => onChange(withPlace(document, ["when"], value ?? undefined))} />
    </fieldset>
  );
}
