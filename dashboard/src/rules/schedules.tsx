/** When rules fire by themselves: the next times in their own zones. */

import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rulesApi } from "../api/rules";
import { ageText, now } from "../live/age";
import { Link } from "../ui/parts";
import { inText, inZone } from "./times";
import { ruleHref } from "./words";

const EVERY_MS = 10_000;
const MISSED: Record<string, string> = { skip: "skipped", once: "fired once", all: "fired each" };

export function SchedulesPart() {
  const asked = useAsked(rulesApi.schedules, EVERY_MS);
  const rows = asked.value.value;
  const sorted = rows && [...rows].sort((a, b) => Number(b.enabled) - Number(a.enabled) || (a.next ?? "9").localeCompare(b.next ?? "9"));
  return (
    <>
      <p class="hint rule-hint">Times are of the schedule's own zone; an hour that a clock leaps over is left out, one that comes twice counts once.</p>
      <Refusal text={asked.problem.value} />
      {sorted === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : sorted.length === 0 ? (
        <p class="nothing">Nothing fires by the clock. <Link href="/rules?show=new" class="text-link">A new rule</Link> can: every five minutes, at three at night, or once at a time.</p>
      ) : (
        <table class="admin-table">
          <thead><tr><th scope="col">Rule</th><th scope="col">Schedule</th><th scope="col">Next</th><th scope="col">Last</th><th scope="col">Missed ones are</th><th scope="col">State</th></tr></thead>
          <tbody>
            {sorted.map((one) => (
              <tr key={one.rule} data-schedule={one.rule}>
                <td class="cell-name"><Link href={ruleHref(one.rule)} class="text-link">{one.rule}</Link></td>
                <td data-label="Schedule"><code>{one.expression}</code><span class="sub">{one.timezone}</span></td>
                <td class="num" data-label="Next">{one.enabled && one.next ? <>{inText(one.next, now.value)}<span class="sub">{inZone(one.next, one.timezone)}</span></> : "–"}</td>
                <td class="num" data-label="Last">{one.last ? `${ageText(now.value - Date.parse(one.last))} ago` : "never"}</td>
                <td data-label="Missed ones are">{MISSED[one.misfire] ?? one.misfire}</td>
                <td data-label="State"><Badge tone={one.enabled ? "good" : "off"}>{one.enabled ? "on" : "off"}</Badge></td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </>
  );
}
