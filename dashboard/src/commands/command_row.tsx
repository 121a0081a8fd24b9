/** One command of the history: what was asked, how far it is, and behind it what came of it. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Command } from "../api/commands";
import { ageText, now } from "../live/age";
import { duration } from "../ui/format";
import { Link } from "../ui/parts";
import { isObject, writeJson, type Json } from "../values/json";
import { StepTrack } from "./step_track";
import { isOver } from "./steps";
import { fieldOf, titleOf, whyOf } from "./words";

interface RowProps {
  command: Command;
  /** It was sent from this page a moment ago. */
  fresh: boolean;
  onCancel?: () => void;
  onAgain?: () => void;
}

export function CommandRow({ command, fresh, onCancel, onAgain }: RowProps) {
  const open = useSignal(fresh);
  useEffect(() => {
    if (fresh) open.value = true;
  }, [fresh]);
  return (
    <li data-command={command.id} data-state={command.state} data-fresh={fresh || undefined}>
      <details open={open.value} onToggle={(event) => (open.value = event.currentTarget.open)}>
        <summary>
          <span class="command-what">
            <b class="wrap">{titleOf(command)}</b>
            <Sub command={command} />
          </span>
          <StepTrack command={command} />
        </summary>
        {open.value && <Inside command={command} onAgain={onAgain} />}
      </details>
      {onCancel && <button type="button" class="button" aria-label={`Take back: ${titleOf(command)}`} onClick={onCancel}>Take back…</button>}
    </li>
  );
}

function Sub({ command }: { command: Command }) {
  const at = now.value;
  const { state, durable, expires, issued, issued_by: by } = command;
  const why = state === "done" ? "" : whyOf(command);
  const leftMs = durable && !isOver(state) && expires ? Date.parse(expires) - at : null;
  return (
    <span class="sub">
      {why && <span class={state === "cancelled" ? undefined : "bad"}>{why} · </span>}
      {by} · {ageText(at - Date.parse(issued))} ago
      {durable && <span class="chip">durable</span>}
      {leftMs !== null && <span> {leftMs > 0 ? `expires in ${duration(leftMs / 1000)}` : "its time is over"}</span>}
    </span>
  );
}

function Inside({ command, onAgain }: { command: Command; onAgain?: () => void }) {
  const facts: [string, string][] = [
    ["Id", command.id],
    ["Issued", command.issued],
    ["Expires", command.expires ?? ""],
    ["Time-out", duration(command.timeout_s)],
    ["Code", command.code],
    ["Key", command.idempotency_key ?? ""],
  ];
  return (
    <div class="command-inside">
      <section aria-label="Request">
        <h3>Request</h3>
        <pre>{writeJson(command.request, 2)}</pre>
      </section>
      <section aria-label="Result">
        <h3>Result</h3>
        <Result command={command} />
      </section>
      <dl>
        {facts.filter(([, value]) => value !== "").map(([name, value]) => (
          <div key={name}><dt>{name}</dt><dd class="mono wrap">{value}</dd></div>
        ))}
      </dl>
      {onAgain && <p><button type="button" class="button" onClick={onAgain}>Send again…</button></p>}
    </div>
  );
}

/** What came back: text of a log, a recording to look at, or the answer as it is. */
function Result({ command }: { command: Command }) {
  const { state, kind, result } = command;
  if (!isOver(state)) return <p class="hint">It is not over yet.</p>;
  if (state !== "done") return <p class="bad wrap">{whyOf(command)}</p>;
  if (result === null) return <p class="hint">It went well; there is nothing more to tell.</p>;
  const lines = kind === "read_log" ? linesOf(result) : null;
  if (lines) return <pre tabIndex={0}>{lines.join("\n") || "No line."}</pre>;
  const recording = kind === "save_recording" ? fieldOf(result, "recording") : "";
  return (
    <>
      <pre tabIndex={0}>{writeJson(result, 2)}</pre>
      {recording && <p class="hint"><Link class="text-link" href="/recordings">To the recordings</Link></p>}
    </>
  );
}

function linesOf(result: Json): string[] | null {
  const lines = isObject(result) ? result.lines : null;
  return Array.isArray(lines) ? lines.map((line) => fieldOf(line, "text")) : null;
}
