/** Who changed a rule, when, and what it said then. */

import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rulesApi, type Rule } from "../api/rules";
import { clockTime, dayText } from "../ui/format";
import { textOf } from "./document";

const EVERY_MS = 30_000;

export function HistoryPart({ rule }: { rule: Rule }) {
  const asked = useAsked(() => rulesApi.history(rule.name), EVERY_MS);
  const rows = asked.value.value;
  return (
    <>
      <Refusal text={asked.problem.value} />
      {rows === null ? !asked.problem.value && <p class="quiet">Asking the gateway…</p> : (
        <ol class="audit calls rule-history">
          {rows.map((one) => (
            <li key={one.revision} data-revision={one.revision}>
              <details>
                <summary>
                  <span class="call-status num">revision {one.revision}</span>
                  <span class="audit-when num">{dayText(Date.parse(one.at))} <span>{clockTime(Date.parse(one.at))}</span></span>
                  <span class="audit-what">{one.what} by <b>{one.by || "the gateway"}</b></span>
                </summary>
                <pre class="fn-log">{textOf(one.document)}</pre>
              </details>
            </li>
          ))}
        </ol>
      )}
    </>
  );
}
