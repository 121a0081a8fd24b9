/** The settings of a function as a form; a change holds for $LATEST, from its next call on. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { functionsApi, type FunctionDetail } from "../api/functions";
import { changeOf, formOf, isNumber, wrongLine, type SettingsForm } from "./settings";

export function SettingsDialog({ one, onClose, onDone }: { one: FunctionDetail; onClose: () => void; onDone: () => void }) {
  const form = useSignal<SettingsForm>(formOf(one));
  const { busy, problem, attempt } = useAttempt();
  const set = (change: Partial<SettingsForm>) => (form.value = { ...form.value, ...change });
  const change = changeOf(one, form.value);
  const wrong = wrongLine(form.value.environment);
  const numbers = (["timeout", "memory", "disk", "retries", "age"] as const).every((field) => isNumber(form.value[field]));
  const reserved = form.value.reserved.trim() === "" || isNumber(form.value.reserved);
  const number = (label: string, field: keyof SettingsForm, note: string, may = false) => (
    <TextField label={label} note={note} mono placeholder={may ? "no bound" : ""} value={form.value[field]} problem={isNumber(form.value[field]) || (may && form.value[field].trim() === "") ? "" : "is no whole number"} onInput={(text) => set({ [field]: text })} />
  );
  return (
    <Modal title={`Settings of ${one.name}`} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await functionsApi.set(one.name, change);
              close();
              onDone();
            });
          }}
        >
          <TextField label="Description" most={256} value={form.value.description} onInput={(text) => set({ description: text })} />
          <TextField label="Handler" mono value={form.value.handler} onInput={(text) => set({ handler: text })} />
          <div class="check-fields">
            {number("Timeout", "timeout", "seconds")}
            {number("Memory", "memory", "MB")}
            {number("Disk", "disk", "MB")}
            {number("At a time", "reserved", "calls", true)}
            {number("Retries of events", "retries", "0 to 2")}
            {number("Age of events", "age", "seconds")}
          </div>
          <TextField label="Events that worked go to" note="an ARN" mono placeholder="nowhere" value={form.value.onSuccess} onInput={(text) => set({ onSuccess: text })} />
          <TextField label="Events that failed go to" note="an ARN" mono placeholder="the dead letters" value={form.value.onFailure} onInput={(text) => set({ onFailure: text })} />
          <label class="field">
            <span>Environment <small>NAME=value, a line each</small></span>
            <textarea class="text mono fn-env" rows={4} spellcheck={false} value={form.value.environment} aria-invalid={wrong !== ""} onInput={(event) => set({ environment: event.currentTarget.value })} />
            {wrong && <small class="bad" role="alert">{wrong} is no NAME=value</small>}
          </label>
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || Object.keys(change).length === 0 || wrong !== "" || !numbers || !reserved}>Save</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
