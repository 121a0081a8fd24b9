/** The recordings page: clips cut from robots' black boxes, an export of what is stored, and the store itself. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { saidOf } from "../api/client";
import { can } from "../api/session";
import type { Recording } from "../api/history_types";
import { recordingsApi } from "../api/recordings";
import { robots } from "../live/fleet";
import { ExportDialog } from "../panels/time_bar/export_dialog";
import { RecordingRow } from "../panels/time_bar/recording_row";
import { StorageCard } from "../panels/uplink/storage";
import { SAVED_S } from "../panels/time_bar/save_button";
import { useLive } from "../ui/context";
import { MayNot } from "../ui/parts";

const IDLE_MS = 4000;
const BUSY_MS = 1000;
const isBusy = ({ state }: Recording) => state !== "stored" && state !== "failed";

export function RecordingsPage() {
  const { stream } = useLive();
  const list = useSignal<Recording[] | null>(null);
  const problem = useSignal("");
  const dialog = useRef<HTMLDialogElement>(null);
  const busy = list.value?.some(isBusy) ?? false;

  const refresh = async () => {
    if (stream.state.peek() !== "open" || document.hidden) return;
    try {
      list.value = await recordingsApi.list();
      problem.value = "";
    } catch (error) {
      problem.value = saidOf(error);
    }
  };
  useEffect(() => {
    const timer = setInterval(() => void refresh(), busy ? BUSY_MS : IDLE_MS);
    const stop = stream.state.subscribe((state) => {
      if (state === "open") void refresh();
    });
    return () => {
      clearInterval(timer);
      stop();
    };
  }, [busy]);

  const run = async (work: Promise<unknown>) => {
    try {
      await work;
      await refresh();
    } catch (error) {
      problem.value = saidOf(error);
    }
  };
  return (
    <>
      <div class="page-head">
        <h1>Recordings</h1>
        {can("recordings.save") ? <SaveForm onSave={(robot) => void run(recordingsApi.saveLast(robot, SAVED_S))} /> : <MayNot what="save clips" />}
        <button type="button" class="button" onClick={() => dialog.current?.showModal()}>Export MCAP…</button>
      </div>
      {problem.value && <p class="problem" role="alert">{problem.value}</p>}
      {list.value === null ? <p class="quiet">Asking the gateway…</p> : list.value.length === 0 ? <Empty /> : (
        <table class="recordings">
          <thead>
            <tr>
              <th scope="col">State</th>
              <th scope="col">Robot</th>
              <th scope="col">From</th>
              <th scope="col" class="end">Length</th>
              <th scope="col" class="end">Messages</th>
              <th scope="col" class="end">Size</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {list.value.map((one) => (
              <RecordingRow key={one.id} recording={one} onDelete={() => void run(recordingsApi.remove(one.id))} />
            ))}
          </tbody>
        </table>
      )}
      <StorageCard />
      <ExportDialog dialog={dialog} />
    </>
  );
}

function SaveForm({ onSave }: { onSave: (robot: string) => void }) {
  const list = robots.value ?? [];
  const chosen = useSignal("");
  const robot = list.some(({ id }) => id === chosen.value) ? chosen.value : (list.find(({ state }) => state === "online") ?? list[0])?.id;
  return (
    <form
      class="save-form"
      onSubmit={(event) => {
        event.preventDefault();
        if (robot) onSave(robot);
      }}
    >
      <label>
        <span class="visually-hidden">Robot to record</span>
        <select value={robot} disabled={list.length === 0} onChange={(event) => (chosen.value = event.currentTarget.value)}>
          {list.map(({ id, state }) => <option key={id} value={id}>{state === "online" ? id : `${id} (offline)`}</option>)}
        </select>
      </label>
      <button class="button button-main" disabled={!robot}><i class="dot" aria-hidden="true" /> Save last 60 s</button>
    </form>
  );
}

function Empty() {
  return (
    <section class="empty empty-near">
      <h1>No recordings yet</h1>
      <p>
        Every robot keeps its last minutes at full rate in a black box. <b>Save last 60 s</b> cuts a clip from it and brings it here,
        also when the link comes back only later.
      </p>
      <pre>metaros recording save sim_1 --last 60s</pre>
    </section>
  );
}
