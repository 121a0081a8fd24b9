/** Who changed what is desired, when and why; each change with its differences, and a way back to it. */

import { useSignal } from "@preact/signals";
import { agoText } from "../admin/accounts";
import { Refusal, useAttempt } from "../admin/modal";
import { can } from "../api/session";
import { twinApi, type Twin, type TwinChange, type TwinEntry } from "../api/twin";
import { now } from "../live/age";
import { ChangeList } from "./change_list";

interface HistoryProps {
  twin: Twin;
  entries: TwinEntry[] | null;
  problem: string;
  onChanged: () => Promise<void>;
}

export function TwinHistory({ twin, entries, problem, onChanged }: HistoryProps) {
  return (
    <section class="card card-history" aria-labelledby="twin-history" data-card="history">
      <header><h2 id="twin-history">History</h2>{entries && entries.length > 0 && <span class="note num">{entries.length}</span>}</header>
      <Refusal text={problem} />
      {entries === null ? (
        <p class="hint pad-in">Asking the gateway…</p>
      ) : entries.length === 0 ? (
        <p class="hint pad-in">Nobody has changed anything yet.</p>
      ) : (
        <ol class="twin-history">
          {entries.map((entry, i) => <Entry key={entry.edition} entry={entry} twin={twin} open={i === 0} onChanged={onChanged} />)}
        </ol>
      )}
    </section>
  );
}

function Entry({ entry, twin, open, onChanged }: { entry: TwinEntry; twin: Twin; open: boolean; onChanged: () => Promise<void> }) {
  const tried = useSignal<TwinChange | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const newest = entry.edition === twin.edition;
  const lives = twin.reported?.applied === entry.revision;
  const seen = { revision: twin.revision, edition: twin.edition };
  const look = () =>
    attempt(async () => {
      tried.value = await twinApi.revert(twin.robot, entry.revision, { dryRun: true, seen });
    });
  const back = () =>
    attempt(async () => {
      await twinApi.revert(twin.robot, entry.revision, { dryRun: false, seen });
      tried.value = null;
      await onChanged();
    });
  return (
    <li data-entry={entry.revision}>
      <details open={open}>
        <summary>
          <b class="num">{entry.revision}</b>
          <span class="entry-what">
            {entry.author || "somebody"} <span class="sub">{entry.reason || `${entry.changes.length} ${entry.changes.length === 1 ? "change" : "changes"}`}</span>
          </span>
          <span class="entry-when" title={entry.at}>
            {newest ? <span class="chip">desired</span> : lives && <span class="chip">on the robot</span>} <small class="num">{agoText(entry.at, now.value)}</small>
          </span>
        </summary>
        <div class="entry-more">
          <ChangeList changes={entry.changes} none="The document stayed as it was: labels, or the robot's own part of it, changed." />
          {!newest && can("twin.write") && !tried.value && (
            <p><button type="button" class="button" disabled={busy.value} onClick={() => void look()}>Go back to this…</button></p>
          )}
          {tried.value && (
            <div class="tried" data-tried>
              <h3>Going back to revision {entry.revision} would change</h3>
              <ChangeList changes={tried.value.changes} more={tried.value.more} />
              <p class="hint">The robot's own document becomes what it was then; templates stay as they are. The robot gets it as a new revision.</p>
              <div class="dialog-end">
                <span />
                <button type="button" class="button" onClick={() => (tried.value = null)}>Cancel</button>
                <button type="button" class="button button-solid" disabled={busy.value || !tried.value.changed} onClick={() => void back()}>Go back</button>
              </div>
            </div>
          )}
          <Refusal text={problem.value} />
        </div>
      </details>
    </li>
  );
}
