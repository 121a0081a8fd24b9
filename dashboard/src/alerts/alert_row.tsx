/** One alert of the list: how bad, what, where, since when, and the one thing that is done most. */

import type { Alert } from "../api/alerts";
import { can } from "../api/session";
import { now } from "../live/age";
import { clockTime, dayText } from "../ui/format";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";
import { alertHref, SeverityBadge, StateChips } from "./badges";
import { beganMs, causeWords, isOver, lastsText } from "./words";

const DAY_MS = 86_400_000;

export function AlertRow({ alert, onAcknowledge }: { alert: Alert; onAcknowledge: () => void }) {
  const at = now.value;
  const began = beganMs(alert);
  return (
    <li data-alert-row={alert.id} data-over={isOver(alert)} data-quiet={alert.quiet} class={`alert-row side-${alert.severity}`}>
      <SeverityBadge severity={alert.severity} />
      <div class="alert-what">
        <h3><Link href={alertHref(alert.id)} class="alert-link">{alert.title}</Link></h3>
        <p class="alert-reason">{alert.reason}</p>
        <p class="alert-facts">
          {alert.robot && <Link href={robotHref(alert.robot)} class="chip chip-link">{alert.robot}</Link>}
          <span class="chip">{causeWords(alert.cause)}</span>
          <StateChips alert={alert} />
        </p>
      </div>
      <p class="alert-when num">
        <b>{lastsText(alert, at)}</b>
        <span>{at - began > DAY_MS && `${dayText(began)} `}{clockTime(began)}</span>
      </p>
      <span class="alert-do">
        {alert.state === "open" && can("alerts.handle") && <button type="button" class="button" onClick={onAcknowledge}>Acknowledge</button>}
      </span>
    </li>
  );
}
