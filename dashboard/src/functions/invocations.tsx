/** The calls of a function, newest first: filtered by how they ended, each with what it printed. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { functionsApi, type Invocation, type InvocationQuery } from "../api/functions";
import { saidOf } from "../api/client";
import { now } from "../live/age";
import { clockTime, dayText } from "../ui/format";
import { Link } from "../ui/parts";
import { place, robotHref, setParam } from "../ui/url";
import { KIND_WORDS, milliseconds, STATUS_TONES } from "./words";

const EVERY_MS = 4000;
const PAGE = 50;
const DAY_MS = 86_400_000;
const STATUSES = ["", "ok", "error", "timeout", "throttled"] as const;
const KINDS = ["", "event", "request", "mapping", "robot", "test"] as const;

const among = <T extends string>(known: readonly T[], asked: string | null): T => known.find((one) => one === asked) ?? known[0]!;

export function InvocationsPart({ name }: { name: string }) {
  const params = place.value.params;
  const status = among(STATUSES, params.get("status"));
  const kind = among(KINDS, params.get("kind"));
  const robot = params.get("robot") ?? "";
  const query: InvocationQuery = { status, kind, robot, limit: PAGE };
  const asked = useAsked(() => functionsApi.invocations(name, query), EVERY_MS);
  const older = useSignal<Invocation[]>([]);
  const next = useSignal<string | null>(null);
  const problem = useSignal("");
  const page = asked.value.value;
  useEffect(() => {
    older.value = [];
    next.value = null;
    void asked.refresh();
  }, [status, kind, robot]);
  const rows = page ? [...page.invocations, ...older.value.filter((one) => !page.invocations.some(({ id }) => id === one.id))] : null;
  const before = older.value.length > 0 ? next.value : (page?.next ?? null);
  const more = async () => {
    problem.value = "";
    try {
      const found = await functionsApi.invocations(name, { ...query, before: before ?? "" });
      older.value = [...older.value, ...found.invocations];
      next.value = found.next;
    } catch (error) {
      problem.value = saidOf(error);
    }
  };
  return (
    <>
      <div class="alert-filters">
        <div class="segments" role="group" aria-label="Status">
          {STATUSES.map((word) => <button key={word} type="button" aria-pressed={status === word} onClick={() => setParam("status", word)}>{word || "any"}</button>)}
        </div>
        <select aria-label="Kind" value={kind} onChange={(event) => setParam("kind", event.currentTarget.value)}>
          {KINDS.map((word) => <option key={word} value={word}>{word ? KIND_WORDS[word] : "every kind"}</option>)}
        </select>
        <label class="search">
          <span class="visually-hidden">Robot</span>
          <input type="search" placeholder="Robot   /" value={robot} onInput={(event) => setParam("robot", event.currentTarget.value)} />
        </label>
      </div>
      <Refusal text={asked.problem.value || problem.value} />
      {rows === null ? <p class="quiet">Asking the gateway…</p> : rows.length === 0 ? (
        <p class="nothing">{status || kind || robot ? "No call was like that." : "It was not called yet. The Test tab calls it with an example event."}</p>
      ) : <ol class="audit calls">{rows.map((one) => <Call key={one.id} one={one} />)}</ol>}
      {before && <p class="lanes-more"><button type="button" class="button" onClick={() => void more()}>Older calls</button></p>}
    </>
  );
}

function Call({ one }: { one: Invocation }) {
  const began = Date.parse(one.began);
  return (
    <li data-call={one.request_id} data-status={one.status} data-outcome={one.status === "ok" || one.status === "throttled" ? "done" : "refused"}>
      <details>
        <summary>
          <span class="call-status"><Badge tone={STATUS_TONES[one.status]}>{one.status}</Badge></span>
          <span class="audit-when num">{now.value - began > DAY_MS && `${dayText(began)} `}<span>{clockTime(began)}</span></span>
          <span class="audit-what">
            {one.error_message || one.error_type ? <><b>{one.error_type}</b> {one.error_message}</> : <span class="none">{KIND_WORDS[one.kind]}{one.qualifier && ` by ${one.qualifier}`}</span>}
            {one.robot && <> <Link href={robotHref(one.robot)} class="chip chip-link">{one.robot}</Link></>}
          </span>
          <span class="call-took num">{milliseconds(one.duration_ms)}{one.init_ms > 0 && <small> cold +{milliseconds(one.init_ms)}</small>}</span>
        </summary>
        <dl class="call-facts">
          <div><dt>Request</dt><dd><code>{one.request_id}</code></dd></div>
          <div><dt>Version</dt><dd>{one.version}{one.qualifier && ` by ${one.qualifier}`}</dd></div>
          <div><dt>Kind</dt><dd>{KIND_WORDS[one.kind]}</dd></div>
          {one.max_memory_mb > 0 && <div><dt>Memory</dt><dd class="num">{one.max_memory_mb}{"\u202f"}MB at most</dd></div>}
        </dl>
        <pre class="fn-log">{one.log || "It printed nothing, or you may not see its log."}</pre>
      </details>
    </li>
  );
}
