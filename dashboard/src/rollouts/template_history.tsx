/** A template's history: who changed it, when and why, and a way back that is tried before it is taken. */

import { useSignal } from "@preact/signals";
import { agoText } from "../admin/accounts";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { can } from "../api/session";
import { templatesApi, type Template, type TemplateChange, type TemplateEntry, type TemplateOptions } from "../api/templates";
import { now } from "../live/age";
import { ChangeList } from "../twin/change_list";
import { Plan } from "../twin/review";
import { USUAL_WINDOW_S } from "./template_editor";
import { robotsText } from "./words";

const EVERY_MS = 10_000;
const SHOWN = 30;

export function TemplateHistory({ one, onClose, onDone }: { one: Template; onClose: () => void; onDone: () => Promise<void> }) {
  const asked = useAsked(() => templatesApi.history(one.name, SHOWN), EVERY_MS);
  const entries = asked.value.value;
  const newest = entries?.[0];
  return (
    <Modal title={`History of ${one.name}`} onClose={onClose}>
      {(close) => (
        <div class="ops">
          <Refusal text={asked.problem.value} />
          {entries === null ? <p class="hint">Asking the gateway…</p> : (
            <ol class="twin-history">
              {entries.map((entry) => (
                <Entry
                  key={entry.revision}
                  entry={entry}
                  newest={newest!}
                  onDone={async () => {
                    await onDone();
                    close();
                  }}
                />
              ))}
            </ol>
          )}
          <div class="dialog-end"><span /><button type="button" class="button" onClick={close}>Close</button></div>
        </div>
      )}
    </Modal>
  );
}

function Entry({ entry, newest, onDone }: { entry: TemplateEntry; newest: TemplateEntry; onDone: () => Promise<void> }) {
  const tried = useSignal<TemplateChange | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const isNewest = entry.revision === newest.revision;
  const options = (dryRun: boolean): TemplateOptions => ({ dryRun, reason: "", confirmWithinS: USUAL_WINDOW_S, seen: newest.removed ? 0 : newest.revision });
  const go = () =>
    attempt(async () => {
      if (tried.value === null) tried.value = await templatesApi.revert(entry.name, entry.revision, options(true));
      else {
        await templatesApi.revert(entry.name, entry.revision, options(false));
        await onDone();
      }
    });
  const made = tried.value;
  return (
    <li data-entry={entry.revision}>
      <details open={isNewest}>
        <summary>
          <b class="num">{entry.revision}</b>
          <span class="entry-what wrap">
            {entry.author} <span class="sub">{entry.removed ? "deleted it" : entry.reason}</span>
          </span>
          <span class="entry-when" title={entry.at}>{isNewest && <span class="chip">now</span>} <small class="num">{agoText(entry.at, now.value)}</small></span>
        </summary>
        <div class="entry-more">
          <p class="hint">{entry.selector || "every robot"} · priority {entry.priority}</p>
          <ChangeList changes={entry.changes} none="The document stayed as it was." />
          {made && <Plan shown={made.results} robots={Number(made.robots)} changed={made.results.filter(({ changed }) => changed)} windowS={USUAL_WINDOW_S} />}
          <Refusal text={problem.value} />
          {!isNewest && !entry.removed && can("templates.write") && (
            <p><button type="button" class={made ? "button button-solid" : "button"} disabled={busy.value} onClick={() => void go()}>{made ? `Go back to it for ${robotsText(Number(made.changed))}` : "Go back to this…"}</button></p>
          )}
        </div>
      </details>
    </li>
  );
}
