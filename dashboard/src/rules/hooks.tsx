/** Hooks: endpoints for webhooks of other systems, each with a secret of its own. */

import { useSignal } from "@preact/signals";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import { Confirm, Modal, Refusal, useAttempt, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rulesApi, type Hook, type HookMade, type HookOrder } from "../api/rules";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { integer } from "../ui/format";
import { MayNot } from "../ui/parts";
import { SecretDialog } from "./secrets";

const EVERY_MS = 10_000;
const AUTH: readonly (readonly [HookOrder["auth"] & string, string])[] = [["signature", "a signature"], ["bearer", "the secret itself"]];
const addressOf = (hook: Pick<Hook, "path">) => location.origin + hook.path;

export function HooksPart() {
  const asked = useAsked(rulesApi.hooks, EVERY_MS);
  const making = useSignal(false);
  const question = useSignal<Question | null>(null);
  const made = useSignal<{ name: string; secret: string; address: string } | null>(null);
  const rows = asked.value.value;
  const rotate = (hook: Hook): Question => ({
    title: `Another secret for ${hook.name}?`,
    text: <p>The present one is good no more, at once: whoever calls the hook needs the new one.</p>,
    yes: "Change it",
    run: async () => void (made.value = { name: hook.name, secret: await rulesApi.rotateHook(hook.name), address: addressOf(hook) }),
  });
  const remove = (hook: Hook): Question => ({
    title: `Delete the hook ${hook.name}?`,
    text: <p>Nothing comes in by it any more.</p>,
    yes: "Delete it",
    run: async () => {
      await rulesApi.removeHook(hook.name);
      await asked.refresh();
    },
  });
  return (
    <>
      <div class="section-head">
        <p class="hint">A hook takes in any JSON that another system sends, as an event that rules listen to.</p>
        {can("rules.write") ? <button type="button" class="button button-solid" onClick={() => (making.value = true)}>New hook…</button> : <MayNot what="make hooks" least="Admins" />}
      </div>
      <Refusal text={asked.problem.value} />
      {rows === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : rows.length === 0 ? (
        <p class="nothing">No hook yet. With one, a build server, a lift or a warehouse system tells the gateway that something happened, and a rule makes something of it.</p>
      ) : (
        <table class="admin-table">
          <thead><tr><th scope="col">Hook</th><th scope="col">Proven by</th><th scope="col" class="end">Taken in</th><th scope="col" class="end">Refused</th><th scope="col">Last used</th><th scope="col"><span class="visually-hidden">Actions</span></th></tr></thead>
          <tbody>
            {rows.map((hook) => (
              <tr key={hook.name} data-hook={hook.name}>
                <td class="cell-name"><b>{hook.name}</b> {hook.robot && <span class="chip">{hook.robot}</span>}<span class="sub">{hook.description || <code>{addressOf(hook)}</code>}</span></td>
                <td data-label="Proven by">{AUTH.find(([word]) => word === hook.auth)![1]}</td>
                <td class="num end" data-label="Taken in">{integer(hook.accepted)}</td>
                <td class={hook.refused > 0 ? "num end bad" : "num end"} data-label="Refused">{integer(hook.refused)}</td>
                <td data-label="Last used">{hook.last_used ? `${ageText(now.value - Date.parse(hook.last_used))} ago` : "never"}</td>
                <td class="cell-actions">{can("rules.write") && <span class="fn-acts"><button type="button" class="button" onClick={() => (question.value = rotate(hook))}>New secret…</button><button type="button" class="button" aria-label={`Delete ${hook.name}`} onClick={() => (question.value = remove(hook))}>Delete…</button></span>}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {making.value && <HookDialog onClose={() => (making.value = false)} onMade={(hook) => {
        made.value = { name: hook.name, secret: hook.secret, address: addressOf(hook) };
        void asked.refresh();
      }} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
      {made.value && <SecretDialog title={`The secret of ${made.value.name}`} secret={made.value.secret} note={`Send to ${made.value.address}`} onClose={() => (made.value = null)} />}
    </>
  );
}

function HookDialog({ onClose, onMade }: { onClose: () => void; onMade: (hook: HookMade) => void }) {
  const form = useSignal({ name: "", description: "", auth: "signature" as "signature" | "bearer", robot: "" });
  const { busy, problem, attempt } = useAttempt();
  const set = (change: Partial<typeof form.value>) => (form.value = { ...form.value, ...change });
  const { name, description, auth, robot } = form.value;
  return (
    <Modal title="New hook" onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              const hook = await rulesApi.addHook(form.value);
              close();
              onMade(hook);
            });
          }}
        >
          <TextField label="Name" mono focus most={63} hint="Its address ends with it: a-z, 0-9, _ . -" value={name} onInput={(text) => set({ name: text })} />
          <TextField label="What it is for" most={500} value={description} onInput={(text) => set({ description: text })} />
          <SegmentedControl label="Who sends proves it with" choices={AUTH} chosen={auth} onChoose={(chosen) => set({ auth: chosen })} />
          <TextField label="About the robot" mono placeholder="none" value={robot} onInput={(text) => set({ robot: text })} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || name === ""}>Make it</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
