/** A message to fill in, field by field as its type has them; small messages inside it stand in one line. */

import type { FieldShape, TypeShape } from "../api/introspect";
import { isObject, type Json } from "../values/json";
import { ValueField } from "../values/value_field";
import { blankItem, fieldOf, isNested, isSmall, lengthProblem, placed, typeText, type Step } from "./shape";

export interface FormProps {
  shape: TypeShape;
  value: Json;
  onChange: (value: Json) => void;
  /** What is typed at a path is, or is not, a value; `a.b.*` is all below it. */
  onInvalid: (path: string, bad: boolean) => void;
}

type PartProps = FormProps & { path: readonly Step[] };

const at = (value: Json, name: string): Json => (isObject(value) && Object.hasOwn(value, name) ? value[name]! : null);

/** The fields of one message of the type; `name` is whose. */
export function MessageFields({ name, path = [], ...props }: FormProps & { name: string; path?: readonly Step[] }) {
  const fields = props.shape.definitions[name]?.fields ?? [];
  if (fields.length === 0) return <p class="hint">Nothing to fill in: this {path.length === 0 ? "type" : "part"} has no fields.</p>;
  return (
    <div class={isSmall(props.shape, name) ? "message-fields message-fields-small" : "message-fields"}>
      {fields.map((field) => <FieldPart key={field.name} field={field} {...props} value={at(props.value, field.name)} onChange={(item) => props.onChange(placed(props.value, [field.name], item))} path={[...path, field.name]} />)}
    </div>
  );
}

function FieldPart({ field, ...props }: PartProps & { field: FieldShape }) {
  if (!isNested(field)) return <PlainPart field={field} {...props} />;
  const title = <><b class="mono">{field.name}</b> <small>{typeText(field)}</small></>;
  if (field.array !== "") return <ListPart field={field} {...props} />;
  return (
    <details class="message-part" open={props.path.length < 4}>
      <summary>{title}</summary>
      <MessageFields name={field.type} {...props} />
    </details>
  );
}

function PlainPart({ field, value, onChange, onInvalid, path }: PartProps & { field: FieldShape }) {
  const where = path.join(".");
  const wrong = Array.isArray(value) ? lengthProblem(field, value.length) : "";
  return (
    <div class="message-field" data-field={where}>
      <ValueField
        label={field.name}
        field={fieldOf(field)}
        value={value ?? undefined}
        hint={wrong || typeText(field)}
        onChange={(item) => {
          onInvalid(where, item === undefined || (Array.isArray(item) && lengthProblem(field, item.length) !== ""));
          if (item !== undefined) onChange(item);
        }}
      />
    </div>
  );
}

/** A list of messages: each can be opened and taken away, and one more added. */
function ListPart({ field, value, onChange, path, ...props }: PartProps & { field: FieldShape }) {
  const items = Array.isArray(value) ? value : [];
  const changeable = field.array !== "fixed";
  const full = field.array === "bounded" && items.length >= field.capacity;
  const take = (index: number) => {
    props.onInvalid(`${path.join(".")}.*`, false);
    onChange(items.filter((_, one) => one !== index));
  };
  return (
    <details class="message-part" open={items.length > 0}>
      <summary><b class="mono">{field.name}</b> <small>{typeText(field)} · {items.length} {items.length === 1 ? "item" : "items"}</small></summary>
      {items.map((item, i) => (
        <div key={i} class="message-item">
          <span class="mono message-index">{i}</span>
          <MessageFields name={field.type} {...props} path={[...path, i]} value={item} onChange={(next) => onChange(placed(items, [i], next))} />
          {changeable && <button type="button" class="unset" aria-label={`Take away ${field.name} ${i}`} onClick={() => take(i)}>×</button>}
        </div>
      ))}
      {changeable && <button type="button" class="button message-add" disabled={full} onClick={() => onChange([...items, blankItem(props.shape, field)])}>Add {typeText({ ...field, array: "" })}</button>}
    </details>
  );
}
