/** A node's log: the newest lines and those that come, older ones on demand, and a search. */

import { useSignal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { Refusal } from "../admin/modal";
import type { Node } from "../api/nodes";
import { clockTime, dayText } from "../ui/format";
import type { Log } from "./log_lines";
import { cut, levelOf } from "./node_words";
import { useLog } from "./use_log";

const TYPING_MS = 350;

export function LogView({ node: { robot, name, online } }: { node: Node }) {
  const typed = useSignal("");
  const query = useSignal("");
  const following = useSignal(true);
  useEffect(() => {
    const timer = setTimeout(() => (query.value = typed.value.trim()), TYPING_MS);
    return () => clearTimeout(timer);
  }, [typed.value]);
  const { log, problem, state, asking, older } = useLog(robot, name, { query: query.value, following: following.value, online });
  return (
    <>
      <div class="log-head">
        <input class="text log-search" type="search" aria-label="Search the log" placeholder="Search the log" maxLength={256} value={typed.value} onInput={(event) => (typed.value = event.currentTarget.value)} />
        <button type="button" class="button" aria-pressed={following.value} data-follow={state.value || "off"} onClick={() => (following.value = !following.value)}>
          {following.value ? (state.value === "broken" ? "Reconnecting…" : "Following") : "Follow"}
        </button>
      </div>
      <Refusal text={problem.value} />
      {log.value === null ? !problem.value && <p class="hint pad-in">Asking the robot…</p> : (
        <Lines log={log.value} query={query.value} asking={asking.value} onOlder={() => void older()} />
      )}
    </>
  );
}

function Lines({ log, query, asking, onOlder }: { log: Log; query: string; asking: boolean; onOlder: () => void }) {
  const box = useRef<HTMLDivElement>(null);
  const seen = useRef<{ atEnd: boolean; height: number; base: number }>({ atEnd: true, height: 0, base: 0 });
  useLayoutEffect(() => {
    const node = box.current;
    if (!node) return;
    const before = seen.current;
    if (before.atEnd) node.scrollTop = node.scrollHeight;
    else if (log.base < before.base) node.scrollTop += node.scrollHeight - before.height; // older ones came above: what is read stays
    seen.current = { ...before, height: node.scrollHeight, base: log.base };
  }, [log]);
  const onScroll = () => {
    const node = box.current!;
    seen.current.atEnd = node.scrollHeight - node.scrollTop - node.clientHeight < 24;
  };
  return (
    <div ref={box} class="log" role="log" aria-label="Log" aria-live="off" tabIndex={0} data-lines={log.lines.length} onScroll={onScroll}>
      {log.older && <button type="button" class="button log-older" disabled={asking} onClick={onOlder}>Older lines</button>}
      {log.lines.length === 0 && <p class="hint">{query ? `No line holds “${query}”.` : "It has said nothing yet."}</p>}
      {log.lines.map((line, i) => <Line key={log.base + i} at={line.at} text={line.text} query={query} />)}
    </div>
  );
}

function Line({ at, text, query }: { at: string | null; text: string; query: string }) {
  const ms = at ? Date.parse(at) : NaN;
  const level = levelOf(text);
  return (
    <p class={level ? `log-line log-${level}` : "log-line"}>
      <time dateTime={at ?? undefined} title={at ?? undefined}>{Number.isNaN(ms) ? "" : Date.now() - ms > 86_400_000 ? `${dayText(ms)} ${clockTime(ms)}` : clockTime(ms)}</time>
      <span>{cut(text, query).map((part, i) => (i % 2 === 1 ? <mark key={i}>{part}</mark> : part))}</span>
    </p>
  );
}
