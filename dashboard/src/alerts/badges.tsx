/** Badges of alerts: severity, state, and why one is quiet. */

import type { Alert, Severity } from "../api/alerts";
import { Link } from "../ui/parts";
import { SHAPES, STATE_WORDS } from "./words";

export const alertHref = (id: string) => `/alerts/${encodeURIComponent(id)}`;

/** A severity as colour, shape and word; without the word it is a name for who cannot see. */
export function SeverityBadge({ severity, bare = false }: { severity: Severity; bare?: boolean }) {
  return (
    <span class={`severity severity-${severity}`} data-severity={severity}>
      <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[severity]} fill-rule="evenodd" /></svg>
      <span class={bare ? "visually-hidden" : undefined}>{severity}</span>
    </span>
  );
}

/** How it stands, in a few words beside each other. */
export function StateChips({ alert }: { alert: Alert }) {
  const { state, acknowledged_by: by, resolved_by: ender, assignee, times, inhibited_by: cause, silence, clearing } = alert;
  return (
    <>
      <span class={`alert-state alert-${state}`} data-alert-state={state}>
        {STATE_WORDS[state]}
        {state === "acknowledged" && by && ` by ${by}`}
        {state === "resolved" && (ender ? ` by ${ender}` : " by itself")}
      </span>
      {clearing && state !== "resolved" && <span class="chip">over, waits to stay so</span>}
      {assignee && <span class="chip">→ {assignee}</span>}
      {times > 1 && <span class="chip num">{times} times</span>}
      {silence && <span class="chip chip-quiet">silenced</span>}
      {cause && <Link href={alertHref(cause)} class="chip chip-quiet chip-link">explained by another</Link>}
    </>
  );
}
