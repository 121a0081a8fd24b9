/** Deploys a zip file: of a new function with its name and handler, or as the new code of one that there is. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { functionsApi, type FunctionDetail } from "../api/functions";
import { bytes } from "../ui/format";

const NAME = /^[A-Za-z0-9_-]{1,64}$/;
/** What the gateway takes at most, see limits.md. */
const MOST_BYTES = 50 * 1024 * 1024;

interface DeployProps {
  /** Absent: a new function. */
  one?: FunctionDetail;
  onClose: () => void;
  onDone: (made: FunctionDetail) => void;
}

export function DeployDialog({ one, onClose, onDone }: DeployProps) {
  const file = useSignal<File | null>(null);
  const name = useSignal(one?.name ?? "");
  const handler = useSignal(one ? "" : "handler.handler");
  const publish = useSignal(false);
  const alias = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  const wrongName = name.value !== "" && !NAME.test(name.value) ? "1 to 64 letters, digits, _ and -" : "";
  const ready = file.value !== null && file.value.size <= MOST_BYTES && NAME.test(name.value) && (one !== undefined || handler.value !== "");
  const take = (taken: File | undefined) => {
    if (!taken) return;
    file.value = taken;
    if (!name.value) name.value = taken.name.replace(/\.zip$/i, "").replace(/[^\w-]+/g, "-").slice(0, 64);
  };
  return (
    <Modal title={one ? `Deploy ${one.name}` : "Deploy a function"} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              const made = await functionsApi.upload(name.value, file.value!, { handler: handler.value, publish: publish.value, alias: publish.value ? alias.value : "" });
              close();
              onDone(made);
            });
          }}
        >
          <Drop file={file.value} onTake={take} />
          {!one && <TextField label="Name" mono required value={name.value} problem={wrongName} onInput={(text) => (name.value = text)} />}
          <TextField label="Handler" mono hint={one ? `Empty: stays ${one.handler}.` : "FILE.FUNCTION: handler.handler is def handler(event, context) in handler.py."} value={handler.value} onInput={(text) => (handler.value = text)} />
          <label class="check choice-check"><input type="checkbox" checked={publish.value} onChange={(event) => (publish.value = event.currentTarget.checked)} /> Publish a version of it</label>
          {publish.value && <TextField label="Alias that leads to it from then on" mono placeholder="none" options={one?.aliases.map((row) => row.name)} value={alias.value} onInput={(text) => (alias.value = text)} />}
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value || !ready}>{busy.value ? "Deploying…" : "Deploy"}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}

function Drop({ file, onTake }: { file: File | null; onTake: (file: File | undefined) => void }) {
  const over = useSignal(false);
  const tooLarge = file !== null && file.size > MOST_BYTES;
  return (
    <label
      class="fn-drop"
      data-over={over.value}
      onDragOver={(event) => {
        event.preventDefault();
        over.value = true;
      }}
      onDragLeave={() => (over.value = false)}
      onDrop={(event) => {
        event.preventDefault();
        over.value = false;
        onTake(event.dataTransfer?.files[0]);
      }}
    >
      <input type="file" accept=".zip,application/zip" class="visually-hidden" aria-label="Zip file" onChange={(event) => onTake(event.currentTarget.files?.[0])} />
      {file ? <b class="wrap">{file.name}</b> : <b>Drop a zip file here</b>}
      <small class={tooLarge ? "bad" : ""}>{file ? `${bytes(file.size)}${tooLarge ? `; at most ${bytes(MOST_BYTES)}` : ""}` : "or press to choose one: the handler's file lies at its top"}</small>
    </label>
  );
}
