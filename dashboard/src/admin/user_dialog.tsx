/** Add a user, or change one: name, role, robots, and how they get in. */

import { useSignal } from "@preact/signals";
import { adminApi, type RoleWord, type SignInLink, type User } from "../api/admin";
import { patternsOf, ROLES, userNameProblem } from "./accounts";
import { CopyField } from "./copy";
import { RobotsField, RoleField, TextField } from "./fields";
import { Modal, Refusal, useAttempt } from "./modal";

interface UserDialogProps {
  /** Null: a new one. */
  user: User | null;
  onClose: () => void;
  onDone: () => Promise<void>;
  onLink: (link: SignInLink) => void;
}

export function UserDialog({ user, onClose, onDone, onLink }: UserDialogProps) {
  const name = useSignal("");
  const role = useSignal<RoleWord>(user?.role ?? "viewer");
  const robots = useSignal(user && !user.robots.includes("*") ? user.robots.join(" ") : "");
  const password = useSignal("");
  const byPassword = useSignal(false);
  const tried = useSignal(false);
  const { busy, problem, attempt } = useAttempt();
  const nameProblem = user || !tried.value ? "" : userNameProblem(name.value.trim());
  const wanted = () => ({ role: role.value, robots: role.value === "admin" ? ["*"] : patternsOf(robots.value) });

  const save = async (close: () => void) => {
    if (user) {
      await adminApi.changeUser(user.name, { ...wanted(), ...(password.value ? { password: password.value } : {}) });
    } else {
      const made = await adminApi.addUser({ name: name.value.trim(), ...wanted(), password: byPassword.value ? password.value : "" });
      await onDone();
      if (!byPassword.value) onLink(await adminApi.makeLink(made.name));
    }
    close();
    void onDone();
  };
  return (
    <Modal title={user ? `Change ${user.name}` : "Add a user"} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            tried.value = true;
            if (user || !userNameProblem(name.value.trim())) void attempt(() => save(close));
          }}
        >
          {!user && (
            <TextField label="Name" placeholder="ada" most={64} focus problem={nameProblem} value={name.value} onInput={(text) => (name.value = text)} />
          )}
          <RoleField role={role} roles={ROLES} />
          <RobotsField role={role.value} text={robots} />
          {user?.external && <p class="hint">{user.name} signs in elsewhere: a role that is given there replaces this one at the next sign-in.</p>}
          {user ? !user.external && <PasswordField label="New password" optional value={password.value} onInput={(text) => (password.value = text)} /> : (
            <fieldset>
              <legend>Signs in first</legend>
              <div class="choices">
                <label class="choice">
                  <input type="radio" name="way" checked={!byPassword.value} onChange={() => (byPassword.value = false)} />
                  <span><b>by a link</b><small>You get a link to pass on; it works once, within 15 minutes.</small></span>
                </label>
                <label class="choice">
                  <input type="radio" name="way" checked={byPassword.value} onChange={() => (byPassword.value = true)} />
                  <span><b>with a password</b><small>You choose it and tell them.</small></span>
                </label>
              </div>
              {byPassword.value && <PasswordField label="Password" value={password.value} onInput={(text) => (password.value = text)} />}
            </fieldset>
          )}
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value}>{user ? "Save" : "Add"}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}

function PasswordField({ label, value, optional = false, onInput }: { label: string; value: string; optional?: boolean; onInput: (text: string) => void }) {
  return (
    <TextField
      label={label}
      note={optional ? "leave empty to keep the present one" : ""}
      hint={`At least 12 characters.${optional ? " A new one ends every session of theirs." : ""}`}
      password
      required={!optional}
      value={value}
      onInput={onInput}
    />
  );
}

/** A sign-in link that was made for somebody. */
export function LinkDialog({ link, onClose }: { link: SignInLink; onClose: () => void }) {
  return (
    <Modal title={`Sign-in link for ${link.user}`} onClose={onClose}>
      {(close) => (
        <>
          <CopyField text={`${location.origin}/signin#${link.token}`} label={`The link that signs ${link.user} in`} name="link" />
          <p class="hint">
            <b class="once">Shown this once.</b> Whoever opens it first is signed in as {link.user}: once, within 15 minutes. Send it the way you would send a password.
          </p>
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Done</button>
          </div>
        </>
      )}
    </Modal>
  );
}
