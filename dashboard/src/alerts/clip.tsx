/** The clip of an alert's evidence: half a minute of the robot's black box at full rate, or the way to ask for it. */

import { Refusal, useAttempt } from "../admin/modal";
import { alertsApi, type AlertDetail } from "../api/alerts";
import { can } from "../api/session";
import { MayNot } from "../ui/parts";
import { lazy } from "../views/lazy";

const ClipState = lazy(async () => (await import("./clip_state")).ClipState, <p class="hint">Asking the gateway…</p>);

export function ClipCard({ one, refresh }: { one: AlertDetail; refresh: () => Promise<void> }) {
  const { busy, problem, attempt } = useAttempt();
  const ask = () =>
    attempt(async () => {
      await alertsApi.clip(one.id);
      await refresh();
    });
  return (
    <section class="card" aria-label="Evidence" data-clip={one.clip}>
      <header><h2>Evidence</h2></header>
      <div class="alert-acts">
        {one.clip ? <ClipState key={one.clip} robot={one.robot} id={one.clip} /> : (
          <>
            <p class="hint">The robot keeps its last minutes at full rate. A clip of 30 s before the moment and 10 s after it can be cut from them.</p>
            {can("alerts.handle") ? (
              <p class="act-row"><button type="button" class="button" disabled={busy.value} onClick={() => void ask()}><i class="dot" aria-hidden="true" /> Ask for the clip</button></p>
            ) : <MayNot what="ask for clips" />}
          </>
        )}
        <Refusal text={problem.value} />
      </div>
    </section>
  );
}
