/** What a function prints, as it prints it: paused, searched, cleared. */

import { useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { Refusal } from "../admin/modal";
import type { LogLine } from "../api/functions";
import { clockTime } from "../ui/format";
import { kindOf } from "./tail";
import { useTail } from "./use_tail";

const NEAR_PX = 24;

export function LogPart({ name }: { name: string }) {
  const { lines, problem, live } = useTail(name);
  const held = useSignal<LogLine[] | null>(null);
  const from = useSignal(-1);
  const text = useSignal("");
  const paused = held.value !== null;
  const all = held.value ?? lines.value;
  const shown = all?.filter((line) => line.cursor > from.value && line.text.toLowerCase().includes(text.value.trim().toLowerCase())) ?? null;
  const waiting = paused && lines.value ? lines.value.filter(({ cursor }) => cursor > (held.value!.at(-1)?.cursor ?? -1)).length : 0;
  return (
    <>
      <div class="log-head fn-log-head">
        <input class="text log-search" type="search" aria-label="Search the log" placeholder="Search the log   /" maxLength={256} value={text.value} onInput={(event) => (text.value = event.currentTarget.value)} />
        <span class={`link ${live.value ? "link-open" : ""} fn-live`} role="status" data-live={live.value}>{live.value ? "Live" : "Connecting…"}</span>
        <button type="button" class="button" aria-pressed={paused} onClick={() => (held.value = paused ? null : (lines.value ?? []))}>{paused ? (waiting > 0 ? `Follow (${waiting} new)` : "Follow") : "Pause"}</button>
        <button type="button" class="button" disabled={!shown || shown.length === 0} onClick={() => ((from.value = lines.value?.at(-1)?.cursor ?? -1), (held.value = null))}>Clear</button>
      </div>
      <Refusal text={problem.value} />
      {shown === null ? !problem.value && <p class="quiet">Asking the gateway…</p> : <Lines lines={shown} following={!paused} empty={text.value.trim() ? `No line holds “${text.value.trim()}”.` : "Nothing was printed yet. Each line stands here as soon as it is printed."} />}
    </>
  );
}

function Lines({ lines, following, empty }: { lines: LogLine[]; following: boolean; empty: string }) {
  const box = useRef<HTMLDivElement>(null);
  const atEnd = useRef(true);
  useLayoutEffect(() => {
    if (following && atEnd.current && box.current) box.current.scrollTop = box.current.scrollHeight;
  }, [lines.length, lines.at(-1)?.cursor, following]);
  const onScroll = () => {
    const node = box.current!;
    atEnd.current = node.scrollHeight - node.scrollTop - node.clientHeight < NEAR_PX;
  };
  return (
    <div ref={box} class="fn-tail" role="log" aria-label="Log" aria-live="off" tabIndex={0} data-lines={lines.length} onScroll={onScroll}>
      {lines.length === 0 && <p class="hint">{empty}</p>}
      {lines.map((line) => (
        <p key={line.cursor} class={`tail-line tail-${kindOf(line.text)}`}>
          <time dateTime={line.at}>{clockTime(Date.parse(line.at))}</time>
          <span>{line.text.trimEnd()}</span>
        </p>
      ))}
    </div>
  );
}
