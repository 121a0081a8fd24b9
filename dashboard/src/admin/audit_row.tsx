/** One row of the audit log: a sentence, and everything else on demand. */

import type { AuditRow } from "../api/admin";
import { clockTime, dayText } from "../ui/format";
import { actWords, kindWords, outcomeOf, whoWords, type Outcome } from "./audit_words";
import { Badge, type Tone } from "./badge";

const TONES: Record<Outcome, Tone> = { done: "good", refused: "bad", failed: "warn", unknown: "off" };
const WORDS: Record<Outcome, string> = { done: "done", refused: "refused", failed: "failed", unknown: "no answer seen" };

export function AuditRowView({ row, faulty }: { row: AuditRow; faulty: boolean }) {
  const outcome = outcomeOf(row);
  const kind = kindWords(row);
  const atMs = Date.parse(row.at);
  return (
    <li data-row={row.number} data-outcome={outcome} data-faulty={faulty}>
      <details>
        <summary>
          <span class="audit-number num">{row.number}</span>
          <span class="audit-when num">{Number.isNaN(atMs) ? "no time" : <><span>{clockTime(atMs)}</span> <small>{dayText(atMs)}</small></>}</span>
          <span class="audit-what">
            <b>{whoWords(row)}</b> {kind && <small>({kind}) </small>}{actWords(row)}
            {row.detail && <span class="sub">{row.detail}</span>}
          </span>
          <span class="audit-result">
            {faulty && <Badge tone="bad">does not hold</Badge>}
            {outcome !== "done" && <Badge tone={TONES[outcome]}>{WORDS[outcome]}{row.code && <span class="visually-hidden">: {row.code}</span>}</Badge>}
          </span>
        </summary>
        <dl>
          <Fact name="Time" value={row.at} />
          <Fact name="Who" value={[row.kind, row.name, row.role && row.role !== "none" ? `(${row.role})` : ""].filter(Boolean).join(" ")} />
          <Fact name="Id" value={row.actor} />
          <Fact name="From" value={row.address} />
          <Fact name="Permission" value={row.action} />
          <Fact name="Request" value={`${row.method} ${row.target}`.trim()} />
          <Fact name="Answer" value={[row.status || "", row.code].filter(Boolean).join(" ")} />
          <Fact name="Gateway" value={row.gateway} />
          <Fact name="Hash" value={row.hash} />
        </dl>
      </details>
    </li>
  );
}

function Fact({ name, value }: { name: string; value: string }) {
  if (!value) return null;
  return <div><dt>{name}</dt><dd class="mono">{value}</dd></div>;
}
