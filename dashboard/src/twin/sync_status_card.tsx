/** The sync status on top of the Config tab, the countdown of a trial, and who changed the document. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { agoText } from "../admin/accounts";
import { Badge } from "../admin/badge";
import { Refusal, useAttempt } from "../admin/modal";
import { can } from "../api/session";
import { twinApi, type Twin } from "../api/twin";
import { now } from "../live/age";
import { ChangeList } from "./change_list";
import { left, syncStatusOf, trialOf, type SyncStatus, type Trial } from "./sync_status";

interface SyncStatusCardProps {
  twin: Twin;
  online: boolean;
  onChanged: () => Promise<void>;
  onEdit: (() => void) | null;
}

export function SyncStatusCard({ twin, online, onChanged, onEdit }: SyncStatusCardProps) {
  const sync = syncStatusOf(twin, online);
  const { busy, problem, attempt } = useAttempt();
  const stuck = sync.step === "reverted" || sync.step === "refused";
  const again = () =>
    attempt(async () => {
      await twinApi.retry(twin.robot, "again");
      await onChanged();
    });
  return (
    <section class={`standing standing-${sync.tone}`} aria-labelledby="standing-title" data-standing={sync.step} data-revision={twin.revision}>
      <div class="standing-head">
        <h2 id="standing-title"><span role="status"><Badge tone={sync.tone}>{sync.word}</Badge></span></h2>
        <p>{sync.text}</p>
        <div class="standing-acts">
          {stuck && can("twin.write") && <button type="button" class="button" disabled={busy.value} onClick={() => void again()}>Try it again</button>}
          {onEdit && <button type="button" class="button button-solid" onClick={onEdit}>Edit</button>}
        </div>
      </div>
      <TrialBar twin={twin} sync={sync} />
      <Refusal text={problem.value} />
      {twin.problem && <p class="refusal" role="alert">Templates and the robot's own document do not fit together, so the document stays as it was: {twin.problem}</p>}
      {stuck && twin.behind.length > 0 && (
        <details class="behind" open={twin.behind.length <= 6}>
          <summary>What it did not {sync.step === "refused" ? "take" : "keep"}</summary>
          <ChangeList changes={twin.behind} />
        </details>
      )}
      <dl class="facts">
        <Fact name="Revision" value={twin.revision ? String(twin.revision) : "none"} />
        {twin.reported && <Fact name="Robot lives by" value={twin.reported.applied ? String(twin.reported.applied) : "its own settings"} />}
        {twin.author && <Fact name="Changed by" value={twin.author} />}
        {twin.at && <Fact name="Changed" value={agoText(twin.at, now.value)} title={twin.at} />}
        {twin.reason && <Fact name="Because" value={twin.reason} />}
        {twin.templates.length > 0 && <Fact name="Templates" value={twin.templates.join(", ")} />}
        {Object.keys(twin.labels).length > 0 && <Fact name="Labels" value={Object.entries(twin.labels).map(([key, value]) => `${key}=${value}`).join(", ")} />}
      </dl>
    </section>
  );
}

const Fact = ({ name, value, title }: { name: string; value: string; title?: string }) => (
  <div title={title}><dt>{name}</dt><dd class="wrap">{value}</dd></div>
);

const FRAME_MS = 250;

/** How long the robot waits for its confirmation before it goes back. */
function TrialBar({ twin, sync }: { twin: Twin; sync: SyncStatus }) {
  const trial = useRef<{ trial: Trial | null; first: boolean }>({ trial: null, first: true });
  const at = useSignal(Date.now());
  const known = trial.current;
  known.trial = trialOf(known.trial, twin, sync.step, Date.now(), known.first);
  known.first = false;
  const running = known.trial !== null;
  useEffect(() => {
    if (!running) return;
    at.value = Date.now();
    const timer = setInterval(() => (at.value = Date.now()), FRAME_MS);
    return () => clearInterval(timer);
  }, [running]);
  if (!known.trial) return null;
  const { s, part } = left(known.trial, Number(twin.confirm_within_s), Math.max(at.value, known.trial.sinceMs));
  return (
    <div class="countdown" data-countdown={Math.ceil(s)}>
      <span class="countdown-bar" role="progressbar" aria-label="Time left to confirm" aria-valuemin={0} aria-valuemax={Number(twin.confirm_within_s)} aria-valuenow={Math.ceil(s)}>
        <i style={{ transform: `scaleX(${part})` }} />
      </span>
      <span class="num">{s > 0 ? <>goes back in <b>{Math.ceil(s)} s</b></> : "the window is over: it goes back now"}</span>
    </div>
  );
}
