/** One's own password: the fields to set or change it, and the dialog that the account's menu opens. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { accountApi } from "../api/account";
import { ApiError, saidOf } from "../api/client";
import { session } from "../api/session";
import "../styles/sign_in.css";

const MIN_CHARS = 12; // the gateway's own; it refuses shorter ones too

interface FormProps {
  onDone: () => void;
  /** The word on the button that leaves everything as it is. */
  later: string;
}

/** Asks for the old password where there is one, and for the new one twice. */
export function PasswordForm({ onDone, later }: FormProps) {
  const { name, has_password: has } = session.value!;
  const [old, fresh, again] = [useSignal(""), useSignal(""), useSignal("")];
  const problem = useSignal("");
  const busy = useSignal(false);
  const save = async () => {
    problem.value = fresh.value === again.value ? "" : "The two are not the same.";
    if (problem.value) return;
    busy.value = true;
    try {
      await accountApi.password(old.value, fresh.value);
      onDone();
    } catch (error) {
      const wrong = error instanceof ApiError && error.code === "bad_credentials";
      problem.value = wrong ? "The old password is wrong." : saidOf(error);
    }
    busy.value = false;
  };
  return (
    <form
      class="fields"
      onSubmit={(event) => {
        event.preventDefault();
        void save();
      }}
    >
      <input type="text" name="username" autocomplete="username" value={name} readonly hidden />
      {has && <Field label="Present password" name="old-password" complete="current-password" value={old} />}
      <Field label="New password" name="new-password" complete="new-password" value={fresh} hint={`${MIN_CHARS} characters or more; a few words do well.`} />
      <Field label="The same again" name="again" complete="new-password" value={again} />
      <p class="problem" role="alert">{problem.value}</p>
      <p class="fields-end">
        <button type="button" class="button" onClick={onDone}>{later}</button>
        <button class="button button-main" disabled={busy.value}>{busy.value ? "Saving…" : "Save password"}</button>
      </p>
    </form>
  );
}

interface FieldProps {
  label: string;
  name: string;
  complete: string;
  value: { value: string };
  hint?: string;
}

function Field({ label, name, complete, value, hint }: FieldProps) {
  return (
    <label class="field">
      <span>{label}</span>
      <input
        type="password"
        name={name}
        autocomplete={complete}
        required
        minLength={complete === "new-password" ? MIN_CHARS : undefined}
        maxLength={256}
        value={value.value}
        onInput={(event) => (value.value = event.currentTarget.value)}
      />
      {hint && <small>{hint}</small>}
    </label>
  );
}

export function PasswordDialog({ onClose }: { onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog ref={dialog} class="password" aria-labelledby="password-title" onClose={onClose}>
      <h2 id="password-title">{session.value?.has_password ? "Change password" : "Set a password"}</h2>
      <p class="hint">{session.value?.has_password ? "Your other sessions end." : "Until now you sign in by links only."}</p>
      <PasswordForm later="Cancel" onDone={() => dialog.current?.close()} />
    </dialog>
  );
}
