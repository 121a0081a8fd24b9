/** The audit log: who changed what, the newest first, and whether the log itself is whole. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { adminApi, type AuditPage, type AuditProof, type AuditRow } from "../api/admin";
import { saidOf } from "../api/client";
import { place, setParam } from "../ui/url";
import { ABOUT } from "./audit_acts";
import { AuditRowView } from "./audit_row";
import { withNewer } from "./audit_words";
import { Refusal, useAttempt } from "./modal";
import { AuditIntegrityCard } from "./audit_integrity";

const EVERY_MS = 5000;
const PAGE = 100;

export function AuditPart() {
  const params = place.value.params;
  const [action, name] = [params.get("action") ?? "", params.get("name") ?? ""];
  const at = Number(params.get("at")) || null;
  const proof = useSignal<AuditProof | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const verify = () =>
    void attempt(async () => {
      proof.value = null;
      proof.value = await adminApi.verifyAudit();
    });
  return (
    <>
      <div class="section-head">
        <h2>Audit log</h2>
        <button type="button" class="button button-solid" disabled={busy.value} onClick={verify}>{busy.value ? "Verifying…" : "Verify the log"}</button>
      </div>
      <p class="hint">Everything that changed something, and everybody who was refused. Rows are never deleted; each is bound to the one before it, so that a changed or removed row shows.</p>
      <Refusal text={problem.value} />
      {proof.value && <AuditIntegrityCard proof={proof.value} />}
      <Filters action={action} name={name} />
      {at !== null && (
        <p class="audit-from hint">
          Row {at} and those before it. <button type="button" class="button" onClick={() => setParam("at", "")}>Show the newest</button>
        </p>
      )}
      <Rows key={`${at} ${action} ${name}`} at={at} action={action} name={name} proof={proof.value} />
    </>
  );
}

function Filters({ action, name }: { action: string; name: string }) {
  const known = ABOUT.some(([value]) => value === action);
  return (
    <form class="filters" role="search" onSubmit={(event) => event.preventDefault()}>
      <label class="field">
        <span>About</span>
        <select value={action} onChange={(event) => setParam("action", event.currentTarget.value)}>
          {ABOUT.map(([value, word]) => <option key={value} value={value}>{word}</option>)}
          {!known && <option value={action}>{action}</option>}
        </select>
      </label>
      <label class="field">
        <span>By whom</span>
        <input class="text" type="search" maxLength={128} placeholder="a whole name" autoComplete="off" spellcheck={false} value={name} onChange={(event) => setParam("name", event.currentTarget.value.trim())} />
      </label>
    </form>
  );
}

interface RowsProps {
  /** The first row to show; null: the newest, and what comes. */
  at: number | null;
  action: string;
  name: string;
  proof: AuditProof | null;
}

/** The rows that are shown, and two ways to more of them. */
function useRows({ at, action, name }: RowsProps) {
  const rows = useSignal<AuditRow[] | null>(null);
  const next = useSignal<number | null>(null);
  const loading = useSignal(false);
  const problem = useSignal(""); // of asking for the newest
  const olderProblem = useSignal(""); // stays until older ones are asked for again, whatever comes of the newest
  const asking = useRef(false);
  const ask = async (before: number | undefined, problem: Signal<string>, take: (page: AuditPage) => void) => {
    try {
      take(await adminApi.audit({ before, action, name }, PAGE));
      problem.value = "";
    } catch (error) {
      problem.value = saidOf(error);
    }
  };
  const newest = async () => {
    if (asking.current) return;
    asking.current = true;
    await ask(at === null ? undefined : at + 1, problem, (page) => {
      const joined = withNewer(rows.peek() ?? [], page.rows);
      rows.value = joined.rows;
      if (joined.fresh) next.value = page.next;
    });
    asking.current = false;
  };
  const older = async () => {
    const before = next.peek();
    if (before === null || loading.peek()) return;
    loading.value = true;
    olderProblem.value = "";
    await ask(before, olderProblem, (page) => {
      if (next.peek() !== before) return; // the list began anew meanwhile
      rows.value = [...(rows.peek() ?? []), ...page.rows];
      next.value = page.next;
    });
    loading.value = false;
  };
  return { rows, next, loading, problem, olderProblem, newest, older };
}

function Rows(props: RowsProps) {
  const { at, action, name, proof } = props;
  const { rows, next, loading, problem, olderProblem, newest, older } = useRows(props);
  const end = useRef<HTMLDivElement>(null);
  useEffect(() => {
    void newest();
    if (at !== null) return; // nothing comes before a row that was
    const timer = setInterval(() => {
      if (!document.hidden) void newest();
    }, EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  useEffect(() => {
    const mark = end.current;
    if (!mark) return;
    // A busy page is told of several looks at once: the last one holds.
    const seen = new IntersectionObserver((looks) => looks.at(-1)?.isIntersecting && void older(), { rootMargin: "600px" });
    seen.observe(mark);
    return () => seen.disconnect();
  }, [next.value]);

  const list = rows.value;
  const faulty = new Set(proof?.faults.map(({ number }) => number));
  return (
    <>
      <Refusal text={problem.value} />
      {list === null ? <p class="quiet">Asking the gateway…</p> : list.length === 0 ? (
        <p class="nothing">{action || name ? "Nothing in the log fits. The name has to be written out in full." : "Nothing has happened yet that the log keeps."}</p>
      ) : (
        <ol class="audit" aria-label="Audit log, the newest first">
          {list.map((row) => <AuditRowView key={row.number} row={row} faulty={faulty.has(row.number)} />)}
        </ol>
      )}
      <div ref={end} class="audit-end">
        <Refusal text={olderProblem.value} />
        {next.value !== null && <button type="button" class="button" disabled={loading.value} onClick={() => void older()}>{loading.value ? "Loading…" : "Older rows"}</button>}
        {list !== null && list.length > 0 && next.value === null && <span class="hint">That is all{action || name ? " that fits" : ""}.</span>}
      </div>
    </>
  );
}
