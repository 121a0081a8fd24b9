/** The dialogs of one alert: who sees to it, for how long it is silenced, and whether it is normal. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { alertsApi, type Alert } from "../api/alerts";
import { session } from "../api/session";
import { duration } from "../ui/format";
import { LengthField, USUAL_LENGTH } from "./checks/length_field";

interface DialogProps {
  one: Alert;
  refresh: () => Promise<void>;
  onClose: () => void;
}

export function AssignDialog({ one, refresh, onClose }: DialogProps) {
  const name = useSignal(one.assignee);
  const { busy, problem, attempt } = useAttempt();
  const me = session.value && session.value.kind !== "anonymous" ? session.value.name : "";
  return (
    <Modal title="Who sees to it?" onClose={onClose}>
      {(close) => {
        const give = (to: string) =>
          void attempt(async () => {
            await alertsApi.assign(one.id, to);
            close();
            await refresh();
          });
        return (
          <form
            onSubmit={(event) => {
              event.preventDefault();
              give(name.value.trim());
            }}
          >
            <TextField label="Name" hint="Empty gives it to nobody." most={128} focus value={name.value} onInput={(text) => (name.value = text)} />
            <Refusal text={problem.value} />
            <div class="dialog-end">
              <span>{me && <button type="button" class="button" disabled={busy.value} onClick={() => give(me)}>I do</button>}</span>
              <button type="button" class="button" onClick={close}>Cancel</button>
              <button class="button button-solid" disabled={busy.value}>Assign</button>
            </div>
          </form>
        );
      }}
    </Modal>
  );
}

export function SilenceDialog({ one, refresh, onClose }: DialogProps) {
  const forS = useSignal(USUAL_LENGTH);
  const reason = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  return (
    <Modal title="Silence this alert" onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await alertsApi.silence(one.id, forS.value, reason.value.trim());
              close();
              await refresh();
            });
          }}
        >
          <p class="hint">Nobody is notified of alerts of {one.robot} with this cause meanwhile. They are still seen here.</p>
          <LengthField seconds={forS.value} onChange={(seconds) => (forS.value = seconds)} />
          <TextField label="Why" most={500} value={reason.value} onInput={(text) => (reason.value = text)} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || !(forS.value > 0)}>Silence for {forS.value > 0 ? duration(forS.value) : "…"}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}

export function NormalDialog({ one, refresh, onTaught, onClose }: DialogProps & { onTaught: (lines: string[]) => void }) {
  const text = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  return (
    <Modal title="Is this normal?" onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              onTaught((await alertsApi.normal(one.id, text.value.trim())).taught);
              close();
              await refresh();
            });
          }}
        >
          <p class="hint">
            The gateway learns that what it found on {one.robot} is no fault, and does not open an alert for the like of it again. What is far worse still is one.
          </p>
          <TextField label="Why it is normal" most={2000} focus value={text.value} onInput={(typed) => (text.value = typed)} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value}>It is normal</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
