/** The checks' table: what always is an alert, whatever was learned. An admin changes it. */

import { useSignal } from "@preact/signals";
import { Badge } from "../../admin/badge";
import { SegmentedControl } from "../../admin/segmented_control";
import { TextField } from "../../admin/fields";
import { Modal, Refusal, useAttempt } from "../../admin/modal";
import { useAsked } from "../../admin/use_list";
import { alertsApi, type AlertCheck, type CheckChange, type Severity } from "../../api/alerts";
import { can } from "../../api/session";
import { duration } from "../../ui/format";
import { MayNot } from "../../ui/parts";
import { SeverityBadge } from "../badges";
import { changeOf, formOf, isWrong, type CheckForm } from "./check_form";
import { checkWords, SEVERITIES } from "../words";

const EVERY_MS = 30_000;

export function ChecksPart() {
  const asked = useAsked(alertsApi.checks, EVERY_MS);
  const edited = useSignal<AlertCheck | null>(null);
  const rows = asked.value.value;
  return (
    <>
      <div class="section-head">
        <p class="hint">These hold for every robot from its first minute. What a robot's own past says comes beside them, see Learning.</p>
        {!can("alerts.manage") && <MayNot what="change checks" least="Admins" />}
      </div>
      <Refusal text={asked.problem.value} />
      {rows === null ? <p class="quiet">Asking the gateway…</p> : rows.length === 0 ? <p class="nothing">This gateway watches nothing: it was started with <code>--no-alerts</code>.</p> : (
        <table class="admin-table checks">
          <thead>
            <tr>
              <th scope="col">Check</th>
              <th scope="col">Is an alert when</th>
              <th scope="col">Is over</th>
              <th scope="col">Severity</th>
              <th scope="col">State</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>{rows.map((one) => <CheckRow key={one.id} one={one} onEdit={() => (edited.value = one)} />)}</tbody>
        </table>
      )}
      {edited.value && <CheckDialog one={edited.value} onClose={() => (edited.value = null)} onDone={asked.refresh} />}
    </>
  );
}

function CheckRow({ one, onEdit }: { one: AlertCheck; onEdit: () => void }) {
  return (
    <tr data-check={one.id} data-disabled={!one.enabled}>
      <td class="cell-name"><b>{one.title}</b> <code class="chip">{one.id}</code></td>
      <td data-label="Is an alert when">{checkWords(one)}</td>
      <td data-label="Is over">{one.clear_s > 0 ? `after ${duration(one.clear_s)}` : "at once"}</td>
      <td data-label="Severity"><SeverityBadge severity={one.severity} /></td>
      <td data-label="State">
        <Badge tone={one.enabled ? "good" : "off"}>{one.enabled ? "on" : "off"}</Badge>
        {one.changed.length > 0 && <span class="sub">{one.changed.map(fieldWord).join(", ")} changed{one.changed_by && ` by ${one.changed_by}`}</span>}
      </td>
      <td class="cell-actions">{can("alerts.manage") && <button type="button" class="button" onClick={onEdit} aria-label={`Edit ${one.title}`}>Edit…</button>}</td>
    </tr>
  );
}

const FIELDS: Record<string, string> = { enabled: "on or off", low: "lower bound", high: "upper bound", for_s: "duration", clear_s: "end", severity: "severity" };
const fieldWord = (field: string) => FIELDS[field] ?? field;
const CHOICES: readonly (readonly [Severity, string])[] = [...SEVERITIES].reverse().map((word) => [word, word]);

function CheckDialog({ one, onClose, onDone }: { one: AlertCheck; onClose: () => void; onDone: () => Promise<void> }) {
  const form = useSignal<CheckForm>(formOf(one));
  const { busy, problem, attempt } = useAttempt();
  const set = (change: Partial<CheckForm>) => (form.value = { ...form.value, ...change });
  const change: CheckChange = changeOf(one, form.value);
  const finish = (work: () => Promise<unknown>, close: () => void) =>
    void attempt(async () => {
      await work();
      close();
      await onDone();
    });
  const number = (label: string, field: "low" | "high" | "for_s" | "clear_s", note: string) => (
    <TextField label={label} note={note} mono value={form.value[field]} problem={isWrong(form.value[field], field) ? "is no number that fits" : ""} onInput={(text) => set({ [field]: text })} />
  );
  return (
    <Modal title={one.title} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            finish(() => alertsApi.setCheck(one.id, change), close);
          }}
        >
          <label class="check"><input type="checkbox" checked={form.value.enabled} onChange={(event) => set({ enabled: event.currentTarget.checked })} /> This check is on</label>
          <div class="check-fields">
            {one.low !== null && number("Below", "low", one.unit)}
            {one.high !== null && number("Above", "high", one.unit)}
            {number("For", "for_s", "seconds")}
            {number("Over after", "clear_s", "seconds")}
          </div>
          <SegmentedControl label="Severity" choices={CHOICES} chosen={form.value.severity} onChoose={(severity) => set({ severity })} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span>{one.changed.length > 0 && <button type="button" class="button" disabled={busy.value} onClick={() => finish(() => alertsApi.resetCheck(one.id), close)}>As it comes</button>}</span>
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || Object.keys(change).length === 0}>Save</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
