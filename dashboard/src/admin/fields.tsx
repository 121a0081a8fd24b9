/** Fields of the forms: a line of text, a role, and which robots. */

import type { Signal } from "@preact/signals";
import type { TargetedInputEvent } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import type { RoleWord } from "../api/admin";
import { ROLE_WORDS } from "./accounts";

export function RoleField({ role, roles }: { role: Signal<RoleWord>; roles: readonly RoleWord[] }) {
  return (
    <fieldset>
      <legend>Role</legend>
      <div class="choices">
        {roles.map((word) => (
          <label key={word} class="choice">
            <input type="radio" name="role" value={word} checked={role.value === word} onChange={() => (role.value = word)} />
            <span><b>{word}</b><small>{ROLE_WORDS[word]}</small></span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}

interface TextFieldProps {
  label: string;
  /** Beside the label. */
  note?: string;
  /** Under the field, read with it. */
  hint?: string;
  problem?: string;
  value: string;
  onInput: (text: string) => void;
  mono?: boolean;
  password?: boolean;
  placeholder?: string;
  most?: number;
  required?: boolean;
  disabled?: boolean;
  focus?: boolean;
  /** Offered while one types; anything else may be typed. */
  options?: readonly string[];
}

/** A line of text. It is never anything that a browser should fill in or correct. */
export function TextField(props: TextFieldProps) {
  const { label, note, hint, problem = "", value, onInput, mono = false, password = false, focus = false } = props;
  const id = useId();
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => {
    if (focus) input.current?.focus();
  }, [focus]);
  const common = {
    ref: input,
    id,
    class: mono ? "text mono" : "text",
    autoCapitalize: "none",
    spellcheck: false,
    required: props.required,
    disabled: props.disabled,
    list: props.options && props.options.length > 0 ? `${id}-list` : undefined,
    "aria-invalid": problem !== "",
    "aria-describedby": hint || problem ? `${id}-hint` : undefined,
    value,
    onInput: (event: TargetedInputEvent<HTMLInputElement>) => onInput(event.currentTarget.value),
  } as const;
  return (
    <div class="field">
      <span><label for={id}>{label}</label> {note && <small>{note}</small>}</span>
      {password ? <input type="password" autoComplete="new-password" minLength={12} {...common} /> : <input autoComplete="off" maxLength={props.most} placeholder={props.placeholder} {...common} />}
      {common.list && <datalist id={common.list}>{props.options!.map((option) => <option key={option} value={option} />)}</datalist>}
      {(hint || problem) && <small id={`${id}-hint`} class={problem ? "bad" : undefined} role={problem ? "alert" : undefined}>{problem || hint}</small>}
    </div>
  );
}

/** An admin sees every robot, so there is nothing to choose. */
export function RobotsField({ role, text }: { role: RoleWord; text: Signal<string> }) {
  const all = role === "admin";
  return (
    <TextField
      label="Robots"
      hint={all ? "An admin sees every robot." : "Names or patterns with *, between spaces: arm_1 sim_*. Empty means every robot."}
      placeholder="every robot"
      mono
      disabled={all}
      value={all ? "" : text.value}
      onInput={(typed) => (text.value = typed)}
    />
  );
}
