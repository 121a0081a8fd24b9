/** The integrity of the audit log: whether its hash chain is whole, and what that rests on. */

import type { AuditProof } from "../api/admin";
import { setParam } from "../ui/url";
import { FAULT_WORDS, proofWords } from "./audit_words";

const SHAPES = { good: "m2 6.300 3 3 5-6.600", bad: "m2.500 2.500 7 7m0-7-7 7" };

export function AuditIntegrityCard({ proof }: { proof: AuditProof }) {
  const { head, lines } = proofWords(proof);
  const tone = proof.ok ? "good" : "bad";
  return (
    <section class={`proof proof-${tone}`} role={proof.ok ? "status" : "alert"} data-proof={tone}>
      <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[tone]} /></svg>
      <div>
        <h2>{head}</h2>
        {proof.faults.length > 0 && (
          <ul class="faults">
            {proof.faults.map(({ number, fault, detail }, at) => (
              <li key={at}><button type="button" onClick={() => setParam("at", String(number))}>Row {number}</button> <b>{FAULT_WORDS[fault]}</b> {detail}</li>
            ))}
          </ul>
        )}
        {lines.map((line) => <p key={line}>{line}</p>)}
        {proof.hash && <p class="head-hash">Last row {proof.rows}, hash <code>{proof.hash}</code></p>}
      </div>
    </section>
  );
}
