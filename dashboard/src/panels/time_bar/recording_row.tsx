/** One recording of the list: what it is of, how far it is, and what can be done with it. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Recording, RecordingState } from "../../api/history_types";
import { rfc3339 } from "../../api/history";
import { can } from "../../api/session";
import { recordingsApi } from "../../api/recordings";
import { bytes, clockTime, dayText, duration, integer } from "../../ui/format";
import { Link } from "../../ui/parts";
import { robotHref } from "../../ui/url";

const WORDS: Record<RecordingState, string> = {
  requested: "asked for",
  cutting: "robot is cutting",
  transferring: "on its way",
  stored: "stored",
  failed: "failed",
};
const SHAPES: Record<RecordingState, string> = {
  requested: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Zm0 1.6a3.4 3.4 0 1 0 0 6.8 3.4 3.4 0 0 0 0-6.8Z",
  cutting: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Zm0 1.6a3.4 3.4 0 1 0 0 6.8Z",
  transferring: "M4.8 1h2.4v5h3L6 11 1.800 6h3Z",
  stored: "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z",
  failed: "M1.500 3 3 1.500 6 4.500 9 1.500 10.500 3 7.500 6l3 3L9 10.500l-3-3-3 3L1.500 9l3-3Z",
};

export function RecordingRow({ recording, onDelete }: { recording: Recording; onDelete: () => void }) {
  const { id, robot, state, start, end, size_bytes: size, messages } = recording;
  const [startMs, endMs] = [Date.parse(start), Date.parse(end)];
  const view = `${robotHref(robot)}?t=${rfc3339(Math.round((startMs + endMs) / 2000) * 1000)}&span=15m`;
  return (
    <tr data-recording={id} data-state={state}>
      <td class="cell-state"><RecordingStand recording={recording} /></td>
      <td class="cell-name"><Link href={robotHref(robot)} class="name-link">{robot}</Link></td>
      <td class="num" data-label="From" title={`${start} – ${end}`}>{clockTime(startMs)} <small>{dayText(startMs)}</small></td>
      <td class="end num" data-label="Length">{duration((endMs - startMs) / 1000)}</td>
      <td class="end num" data-label="Messages">{integer(messages || null)}</td>
      <td class="end num" data-label="Size">{bytes(size || null)}</td>
      <td class="end cell-actions">
        <Link href={view} class="button">View</Link>
        {state === "stored" && <a class="button" href={recordingsApi.fileHref(id)} download={`${robot}-${start}.mcap`}>Download</a>}
        {can("recordings.delete") && <DeleteButton onDelete={onDelete} />}
      </td>
    </tr>
  );
}

/** How far a recording is, as shape, colour and word, and what is known beside that. */
export function RecordingStand({ recording }: { recording: Recording }) {
  const { state } = recording;
  return (
    <>
      <span class={`recording-state recording-${state}`}>
        <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[state]} fill-rule="evenodd" /></svg>
        {WORDS[state]}
      </span>
      <Progress recording={recording} />
    </>
  );
}

/** How much of the file is here, or why it will not come. */
function Progress({ recording: { state, size_bytes: size, received_bytes: received, message, code } }: { recording: Recording }) {
  if (state === "failed") return <span class="sub" title={message ?? ""}>{message || code}</span>;
  if (state === "requested") return <span class="sub">waits for the robot</span>;
  if (state !== "transferring" || !size) return null;
  const part = Math.min(1, (received ?? 0) / size);
  return (
    <span class="meter" role="progressbar" aria-valuenow={Math.round(part * 100)} aria-valuemin={0} aria-valuemax={100} title={`${bytes(received)} of ${bytes(size)}`}>
      <i style={{ transform: `scaleX(${part})` }} />
    </span>
  );
}

const ARMED_MS = 4000;

/** Deleting takes a second press, so that none happens by a slip. */
function DeleteButton({ onDelete }: { onDelete: () => void }) {
  const armed = useSignal(false);
  useEffect(() => {
    if (!armed.value) return;
    const timer = setTimeout(() => (armed.value = false), ARMED_MS);
    return () => clearTimeout(timer);
  }, [armed.value]);
  return (
    <button
      type="button"
      class={armed.value ? "button button-danger" : "button"}
      onClick={() => {
        if (armed.value) onDelete();
        armed.value = !armed.value;
      }}
    >
      {armed.value ? "Really?" : "Delete"}
    </button>
  );
}
