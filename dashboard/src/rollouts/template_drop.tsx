/** Taking a template away: what robots lose by it is shown before. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { templatesApi, type Template, type TemplateChange, type TemplateOptions } from "../api/templates";
import { Plan } from "../twin/review";
import { USUAL_WINDOW_S } from "./template_editor";

export function TemplateDrop({ one, onClose, onDone }: { one: Template; onClose: () => void; onDone: () => Promise<void> }) {
  const tried = useSignal<TemplateChange | null>(null);
  const reason = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  const options = (dryRun: boolean): TemplateOptions => ({ dryRun, reason: reason.value.trim(), confirmWithinS: USUAL_WINDOW_S, seen: one.revision });
  useEffect(() => {
    void attempt(async () => {
      tried.value = await templatesApi.remove(one.name, options(true));
    });
  }, []);
  const made = tried.value;
  return (
    <Modal title={`Delete the template ${one.name}?`} onClose={onClose}>
      {(close) => (
        <form
          class="ops"
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await templatesApi.remove(one.name, options(false));
              await onDone();
              close();
            });
          }}
        >
          {made ? <Plan shown={made.results} robots={Number(made.robots)} changed={made.results.filter(({ changed }) => changed)} windowS={USUAL_WINDOW_S} /> : !problem.value && <p class="hint">Looking what would change…</p>}
          <TextField label="Why" most={200} value={reason.value} onInput={(text) => (reason.value = text)} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-danger" disabled={busy.value || made === null}>Delete</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
