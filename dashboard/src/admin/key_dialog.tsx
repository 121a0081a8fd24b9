/** A new key: what it is called, what it may do, how long; then its secret, this once. */

import { useSignal } from "@preact/signals";
import { adminApi, type NewApiKey, type RoleWord } from "../api/admin";
import { session } from "../api/session";
import { KEY_LIVES, patternsOf, rolesUpTo } from "./accounts";
import { CopyField } from "./copy";
import { RobotsField, RoleField, TextField } from "./fields";
import { Modal, Refusal, useAttempt } from "./modal";

const USUAL_LIFE_S = 90 * 86_400;

export function KeyDialog({ onClose, onDone }: { onClose: () => void; onDone: () => Promise<void> }) {
  const own = session.value;
  const roles = rolesUpTo(own?.role ?? "");
  const name = useSignal("");
  const role = useSignal<RoleWord>("viewer");
  const robots = useSignal(own && !own.robots.includes("*") ? own.robots.join(" ") : "");
  const signs = useSignal(false);
  const lifeS = useSignal<number | null>(USUAL_LIFE_S);
  const made = useSignal<NewApiKey | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const make = async () => {
    made.value = await adminApi.makeKey({
      name: name.value.trim(),
      role: role.value,
      robots: role.value === "admin" ? ["*"] : patternsOf(robots.value),
      scopes: signs.value ? ["lambda"] : [],
      expires_s: lifeS.value,
    });
    void onDone();
  };
  return (
    <Modal title={made.value ? `Key ${made.value.name}` : "Make a key"} onClose={onClose}>
      {(close) => made.value ? <NewKey made={made.value} onDone={close} /> : (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(make);
          }}
        >
          <TextField label="Name" placeholder="what will use it, as: wall display" most={64} required focus value={name.value} onInput={(text) => (name.value = text)} />
          <RoleField role={role} roles={roles} />
          <RobotsField role={role.value} text={robots} />
          <div class="field" role="group" aria-label="The key ends">
            <span>Ends after</span>
            <div class="segments">
              {KEY_LIVES.map(([word, seconds]) => (
                <button key={word} type="button" aria-pressed={lifeS.value === seconds} onClick={() => (lifeS.value = seconds)}>{word}</button>
              ))}
            </div>
          </div>
          <label class="choice choice-check">
            <input type="checkbox" checked={signs.value} onChange={(event) => (signs.value = event.currentTarget.checked)} />
            <span><b>also signs requests to functions</b><small>Scope <code>lambda</code>: the gateway keeps the secret sealed, because signatures need it.</small></span>
          </label>
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value}>Make the key</button>
          </div>
        </form>
      )}
    </Modal>
  );
}

function NewKey({ made, onDone }: { made: NewApiKey; onDone: () => void }) {
  return (
    <>
      <CopyField text={made.key} label="The key" name="key" />
      <p class="hint"><b class="once">Shown this once.</b> The gateway cannot show it again: keep it where secrets are kept. If it is lost, revoke it and make another.</p>
      <p class="hint">Programs send it behind <code>Authorization: Bearer</code>; the command line takes it from <code>METAROS_KEY</code>:</p>
      <pre class="example">curl -H "Authorization: Bearer $METAROS_KEY" {location.origin}/api/v1/robots</pre>
      {made.scopes.includes("lambda") && (
        <>
          <p class="hint">For signed requests to functions, the access key id and the secret:</p>
          <CopyField text={made.id} label="The access key id" name="key-id" />
          <CopyField text={made.secret} label="The secret access key" name="key-secret" />
        </>
      )}
      <div class="dialog-end">
        <span />
        <button type="button" class="button" onClick={onDone}>I have kept it</button>
      </div>
    </>
  );
}
