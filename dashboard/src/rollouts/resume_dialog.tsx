/** Going on: in spite of what failed, or with a mended version from the first wave. */

import { useSignal } from "@preact/signals";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rolloutsApi, type Rollout } from "../api/rollouts";
import { isReady, newestFirst, robotsText, thingOf } from "./words";

const NEVER_MS = 3_600_000;

export function ResumeDialog({ one, onClose, onDone }: { one: Rollout; onClose: () => void; onDone: () => Promise<void> }) {
  const updates = useAsked(rolloutsApi.updates, NEVER_MS);
  const bundles = newestFirst(updates.value.value?.bundles ?? []);
  const others = bundles.filter((bundle) => isReady(bundle) && bundle.name === one.bundle && bundle.version !== one.version);
  const version = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  const failed = one.counts.failed;
  return (
    <Modal title={`Resume ${thingOf(one)}`} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await rolloutsApi.resume(one.id, version.value);
              await onDone();
              close();
            });
          }}
        >
          <fieldset class="plain">
            <legend class="visually-hidden">With what</legend>
            <div class="choices">
              <label class="choice">
                <input type="radio" name="version" checked={version.value === ""} onChange={() => (version.value = "")} />
                <span>
                  <b>Go on with {one.version}</b>
                  <small>{failed > 0 ? `${robotsText(failed)} failed; those stay as they are and count no more.` : "From where it stands."}</small>
                </span>
              </label>
              {others.map((bundle) => (
                <label key={bundle.path} class="choice">
                  <input type="radio" name="version" checked={version.value === bundle.version} onChange={() => (version.value = bundle.version)} />
                  <span><b>Begin again with {bundle.version}</b><small>From the first wave, for all {robotsText(one.robots)}.</small></span>
                </label>
              ))}
            </div>
          </fieldset>
          {updates.value.value && others.length === 0 && <p class="hint">There is no other version of {one.bundle} that robots may have. Publish a mended one, and it stands here.</p>}
          <Refusal text={problem.value || updates.problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-solid" disabled={busy.value}>Resume</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
