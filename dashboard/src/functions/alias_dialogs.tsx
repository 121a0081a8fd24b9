/** Dialogs about versions: publish one, let an alias lead to it, or try it on a share of the calls first. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { functionsApi, type Alias, type FunctionDetail } from "../api/functions";
import { percent } from "../ui/format";

interface DialogProps {
  one: FunctionDetail;
  onClose: () => void;
  onDone: () => void;
}

/** What all three are: a form, its refusal, and two buttons. */
function Form({ title, yes, ready, run, onClose, onDone, children }: { title: string; yes: string; ready: boolean; run: () => Promise<unknown>; onClose: () => void; onDone: () => void; children: preact.ComponentChildren }) {
  const { busy, problem, attempt } = useAttempt();
  return (
    <Modal title={title} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await run();
              close();
              onDone();
            });
          }}
        >
          {children}
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || !ready}>{yes}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}

export function PublishDialog({ one, onClose, onDone }: DialogProps) {
  const description = useSignal("");
  return (
    <Form title={`Publish a version of ${one.name}`} yes="Publish" ready run={() => functionsApi.publish(one.name, description.value.trim())} onClose={onClose} onDone={onDone}>
      <p class="hint">The code and settings of now get a number and never change any more. Where nothing changed since the newest version, it is that one.</p>
      <TextField label="What is new" most={256} focus value={description.value} onInput={(text) => (description.value = text)} />
    </Form>
  );
}

function VersionField({ label, one, value, without, onChange }: { label: string; one: FunctionDetail; value: string; without?: string; onChange: (version: string) => void }) {
  return (
    <label class="field">
      <span>{label}</span>
      <select value={value} onChange={(event) => onChange(event.currentTarget.value)}>
        {[...one.published].reverse().filter(({ version }) => version !== without).map(({ version, description }) => <option key={version} value={version}>{version}{description && ` · ${description}`}</option>)}
      </select>
    </label>
  );
}

export function AliasDialog({ one, alias, onClose, onDone }: DialogProps & { alias: Alias | null }) {
  const name = useSignal(alias?.name ?? "");
  const version = useSignal(alias?.version ?? one.published.at(-1)!.version);
  const given = Object.entries(alias?.weights ?? {})[0];
  const other = useSignal(given?.[0] ?? "");
  const share = useSignal(given?.[1] ?? 0.1);
  const weights = other.value && other.value !== version.value ? { [other.value]: share.value } : {};
  return (
    <Form title={alias ? `Alias ${alias.name}` : "New alias"} yes="Save" ready={/^(?!\d+$)[\w-]{1,128}$/.test(name.value)} run={() => functionsApi.setAlias(one.name, name.value, version.value, weights)} onClose={onClose} onDone={onDone}>
      {!alias && <TextField label="Name" mono focus hint="live, test …: not only digits, those are versions." value={name.value} onInput={(text) => (name.value = text)} />}
      <VersionField label="Version" one={one} value={version.value} onChange={(chosen) => (version.value = chosen)} />
      {one.published.length > 1 && (
        <label class="field">
          <span>And now and then</span>
          <select value={other.value} onChange={(event) => (other.value = event.currentTarget.value)}>
            <option value="">no other</option>
            {[...one.published].reverse().filter((row) => row.version !== version.value).map((row) => <option key={row.version} value={row.version}>version {row.version}</option>)}
          </select>
        </label>
      )}
      {other.value && <ShareField label="Its share" value={share.value} onChange={(chosen) => (share.value = chosen)} />}
    </Form>
  );
}

function ShareField({ label, value, onChange }: { label: string; value: number; onChange: (share: number) => void }) {
  return (
    <label class="field fn-share">
      <span>{label} <b class="num">{percent(value)}</b></span>
      <input type="range" min="0.01" max="0.99" step="0.01" value={value} onInput={(event) => onChange(Number(event.currentTarget.value))} />
    </label>
  );
}

export function CanaryDialog({ one, alias, onClose, onDone }: DialogProps & { alias: Alias }) {
  const newest = one.published.filter(({ version }) => version !== alias.version).at(-1)!.version;
  const form = useSignal({ version: newest, weight: 0.1, errors: "5", least: "20", minutes: "5", step: "0" });
  const set = (change: Partial<typeof form.value>) => (form.value = { ...form.value, ...change });
  const { version, weight, errors, least, minutes, step } = form.value;
  const numbers = [errors, least, minutes, step].map(Number);
  const ready = numbers.every((number) => Number.isFinite(number) && number >= 0) && Number(least) >= 1 && Number(minutes) > 0;
  const order = { version, weight, error_rate: Number(errors) / 100, least_invocations: Number(least), for_s: Number(minutes) * 60, step: Number(step) / 100 };
  return (
    <Form title={`Canary for ${one.name}:${alias.name}`} yes="Start" ready={ready} run={() => functionsApi.startCanary(one.name, alias.name, order)} onClose={onClose} onDone={onDone}>
      <p class="hint">The new version gets a share of the calls. Where too many of them fail the alias is back at version {alias.version} by itself.</p>
      <VersionField label="Version" one={one} value={version} without={alias.version} onChange={(chosen) => set({ version: chosen })} />
      <ShareField label="Its share" value={weight} onChange={(chosen) => set({ weight: chosen })} />
      <div class="check-fields">
        <TextField label="Back above" note="% failed" mono value={errors} onInput={(text) => set({ errors: text })} />
        <TextField label="Of at least" note="calls" mono value={least} onInput={(text) => set({ least: text })} />
        <TextField label="On after" note="minutes" mono value={minutes} onInput={(text) => set({ minutes: text })} />
        <TextField label="By steps of" note="%, 0: all at once" mono value={step} onInput={(text) => set({ step: text })} />
      </div>
    </Form>
  );
}
