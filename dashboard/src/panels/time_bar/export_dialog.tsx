/** Choose robots, topics and a span, and download what is stored of them as one MCAP file. */

import { useSignal } from "@preact/signals";
import type { RefObject } from "preact";
import { exportHref } from "../../api/recordings";
import { robots } from "../../live/fleet";

const SPANS_S: [string, number][] = [["1 min", 60], ["15 min", 900], ["1 h", 3600], ["1 day", 86_400]];

/** What an input of type datetime-local holds: the reader's own time, without a zone. */
const local = (ms: number) => new Date(ms - new Date(ms).getTimezoneOffset() * 60_000).toISOString().slice(0, 19);
const globs = (text: string) => text.split(/[\s,]+/).filter(Boolean);

export function ExportDialog({ dialog }: { dialog: RefObject<HTMLDialogElement | null> }) {
  const chosen = useSignal<string[] | null>(null);
  const topics = useSignal("");
  const startMs = useSignal(Date.now() - 900_000);
  const endMs = useSignal(Date.now());
  const all = (robots.value ?? []).map(({ id }) => id);
  const picked = all.filter((id) => chosen.value?.includes(id) ?? true);
  const problem = picked.length === 0 ? "Choose a robot." : startMs.value >= endMs.value ? "The end is before the start." : "";
  const flip = (id: string) => (chosen.value = picked.includes(id) ? picked.filter((one) => one !== id) : [...picked, id]);
  return (
    <dialog ref={dialog} class="export" aria-labelledby="export-title">
      <h2 id="export-title">Export MCAP</h2>
      <p class="hint">Everything stored of the span, in one file for Foxglove, rosbags and mcap. What is missing is named in the file.</p>
      <fieldset>
        <legend>Robots</legend>
        <div class="picks">
          {all.map((id) => (
            <label key={id} class="check"><input type="checkbox" checked={picked.includes(id)} onChange={() => flip(id)} /> {id}</label>
          ))}
          {all.length === 0 && <span class="hint">There is no robot.</span>}
        </div>
      </fieldset>
      <fieldset>
        <legend>Span: the last</legend>
        <div class="segments" role="group">
          {SPANS_S.map(([word, seconds]) => (
            <button
              key={word}
              type="button"
              onClick={() => {
                endMs.value = Date.now();
                startMs.value = endMs.value - seconds * 1000;
              }}
            >
              {word}
            </button>
          ))}
        </div>
        <div class="from-to">
          <TimeInput label="From" ms={startMs.value} onChange={(ms) => (startMs.value = ms)} />
          <TimeInput label="To" ms={endMs.value} onChange={(ms) => (endMs.value = ms)} />
        </div>
      </fieldset>
      <fieldset>
        <legend><label for="export-topics">Topics</label></legend>
        <input
          id="export-topics"
          class="text mono"
          placeholder="**   every topic; or /*/scan /*/odom"
          value={topics.value}
          onInput={(event) => (topics.value = event.currentTarget.value)}
        />
      </fieldset>
      <form method="dialog" class="dialog-end">
        <span class="bad" role="status">{problem}</span>
        <button class="button">Cancel</button>
        <a
          class="button button-main"
          aria-disabled={problem ? "true" : undefined}
          href={problem ? undefined : exportHref(picked, globs(topics.value), startMs.value, endMs.value)}
          download
          onClick={() => problem || dialog.current?.close()}
        >
          Download
        </a>
      </form>
    </dialog>
  );
}

function TimeInput({ label, ms, onChange }: { label: string; ms: number; onChange: (ms: number) => void }) {
  return (
    <label>
      <span>{label}</span>
      <input
        type="datetime-local"
        step="1"
        class="text"
        value={local(ms)}
        onChange={(event) => {
          const found = new Date(event.currentTarget.value).getTime();
          if (Number.isFinite(found)) onChange(found);
        }}
      />
    </label>
  );
}
