/** Silences: what nobody is notified of, until when, by whom and why; and the form that makes one. */

import { useSignal } from "@preact/signals";
import { TextField } from "../../admin/fields";
import { SegmentedControl } from "../../admin/segmented_control";
import { Confirm, Modal, Refusal, useAttempt, type Question } from "../../admin/modal";
import { alertsApi, type Severity, type Silence } from "../../api/alerts";
import { can } from "../../api/session";
import { now } from "../../live/age";
import { clockTime, dayText, duration } from "../../ui/format";
import { MayNot } from "../../ui/parts";
import { LengthField, USUAL_LENGTH } from "./length_field";
import { useAlerts } from "../use_alerts";
import { silencedWords, UP_TO_WORDS } from "../words";

const EVERY_MS = 10_000;

export function SilencesPart() {
  const asked = useAlerts(alertsApi.silences, EVERY_MS);
  const question = useSignal<Question | null>(null);
  const making = useSignal(false);
  const rows = asked.value.value?.filter(({ until }) => Date.parse(until) > now.value) ?? null;
  return (
    <>
      <div class="section-head">
        <p class="hint">A silence keeps alerts from telling anybody; they are still opened, and seen here. It ends by itself.</p>
        {can("alerts.handle") ? (
          <button type="button" class="button button-solid" onClick={() => (making.value = true)}>Silence…</button>
        ) : <MayNot what="silence alerts" />}
      </div>
      <Refusal text={asked.problem.value} />
      {rows === null ? <p class="quiet">Asking the gateway…</p> : rows.length === 0 ? <p class="nothing">Nothing is silenced. During work on a robot, silence it: nobody is called at night because somebody had its cover off.</p> : (
        <table class="admin-table">
          <thead>
            <tr>
              <th scope="col">What</th>
              <th scope="col">Silences</th>
              <th scope="col">Ends</th>
              <th scope="col">By</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {rows.map((one) => <SilenceRow key={one.id} one={one} onEnd={() => (question.value = endQuestion(one, asked.refresh))} />)}
          </tbody>
        </table>
      )}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
      {making.value && <SilenceDialog onClose={() => (making.value = false)} onDone={asked.refresh} />}
    </>
  );
}

function SilenceRow({ one, onEnd }: { one: Silence; onEnd: () => void }) {
  const until = Date.parse(one.until);
  return (
    <tr data-silence={one.id}>
      <td class="cell-name"><b>{silencedWords(one)}</b>{one.reason && <span class="sub">{one.reason}</span>}</td>
      <td data-label="Silences">{UP_TO_WORDS[one.up_to]}</td>
      <td data-label="Ends" title={one.until}>in {duration(Math.max(1, Math.round((until - now.value) / 1000)))} <small class="num">{dayText(until)} {clockTime(until).slice(0, 5)}</small></td>
      <td data-label="By">{one.by}</td>
      <td class="cell-actions">{can("alerts.handle") && <button type="button" class="button" onClick={onEnd}>End…</button>}</td>
    </tr>
  );
}

const endQuestion = (one: Silence, done: () => Promise<void>): Question => ({
  title: "End this silence?",
  text: <p>{silencedWords(one)}. What is wrong there tells people again from now on.</p>,
  yes: "End it",
  run: async () => {
    await alertsApi.endSilence(one.id);
    await done();
  },
});

const words = (text: string) => text.split(/[\s,]+/).filter(Boolean);
const UP_TO: readonly (readonly [Severity, string])[] = [["error", "everything"], ["warning", "warnings and below"], ["info", "infos only"]];

function SilenceDialog({ onClose, onDone }: { onClose: () => void; onDone: () => Promise<void> }) {
  const form = useSignal({ robots: "", causes: "", upTo: "error" as Severity, forS: USUAL_LENGTH, reason: "" });
  const { busy, problem, attempt } = useAttempt();
  const set = (change: Partial<typeof form.value>) => (form.value = { ...form.value, ...change });
  const { robots, causes, upTo, forS, reason } = form.value;
  return (
    <Modal title="Silence alerts" onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await alertsApi.addSilence({ robots: words(robots), causes: words(causes), up_to: upTo, for_s: forS, reason });
              close();
              await onDone();
            });
          }}
        >
          <TextField label="Robots" hint="Names or patterns with *, between spaces: arm_1 sim_*. Empty means every robot, which admins may." placeholder="every robot" mono focus value={robots} onInput={(text) => set({ robots: text })} />
          <TextField label="Causes" hint="offline, silence, battery, heat…, or patterns. Empty means every cause." placeholder="every cause" mono value={causes} onInput={(text) => set({ causes: text })} />
          <SegmentedControl label="Silences" choices={UP_TO} chosen={upTo} onChoose={(value) => set({ upTo: value })} />
          <LengthField seconds={forS} onChange={(value) => set({ forS: value })} />
          <TextField label="Why" most={500} value={reason} onInput={(text) => set({ reason: text })} />
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || !(forS > 0)}>Silence for {forS > 0 ? duration(forS) : "…"}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
