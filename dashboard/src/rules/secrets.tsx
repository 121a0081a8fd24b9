/** The secrets that sign what a rule's webhooks send: a new one is shown once. */

import { useSignal } from "@preact/signals";
import { CopyField } from "../admin/copy";
import { Confirm, Modal, type Question } from "../admin/modal";
import { rulesApi, type Rule } from "../api/rules";

export function TargetSecrets({ rule }: { rule: Rule }) {
  const question = useSignal<Question | null>(null);
  const made = useSignal<{ target: string; secret: string } | null>(null);
  const hooks = (rule.targets ?? []).filter((target) => target.kind === "webhook").map((target) => String(target.id));
  if (hooks.length === 0) return null;
  const ask = (target: string) =>
    (question.value = {
      title: `A new secret for ${target}?`,
      text: <p>What {rule.name} sends there is signed with it from now on; the one before, if there was one, signs nothing any more.</p>,
      yes: "Make it",
      run: async () => void (made.value = { target, secret: await rulesApi.secret(rule.name, target) }),
    });
  return (
    <section class="card rule-secrets" aria-label="Signing secrets">
      <header><h2>Signing secrets</h2><span class="note">Standard Webhooks</span></header>
      <ul class="rows fn-rows">{hooks.map((target) => <li key={target}><code>{target}</code><button type="button" class="button" onClick={() => ask(target)}>New secret…</button></li>)}</ul>
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
      {made.value && <SecretDialog title={`The secret of ${made.value.target}`} secret={made.value.secret} onClose={() => (made.value = null)} />}
    </section>
  );
}

/** Shown this once. */
export function SecretDialog({ title, secret, note = "", onClose }: { title: string; secret: string; note?: string; onClose: () => void }) {
  return (
    <Modal title={title} onClose={onClose}>
      {(close) => (
        <>
          <p class="once">It is shown this once: nobody can look it up later.</p>
          <CopyField text={secret} label="Secret" name="secret" />
          {note && <p class="hint wrap">{note}</p>}
          <div class="dialog-end"><span /><button type="button" class="button button-solid" onClick={close}>I have it</button></div>
        </>
      )}
    </Modal>
  );
}
