/** The Config tab: whether the robot is as it is to be, each value beside what is so, the way to change it, the history. */

import { signal, type Signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { can } from "../api/session";
import { twinApi } from "../api/twin";
import type { Robot } from "../api/types";
import { MayNot } from "../ui/parts";
import { compare } from "./compare";
import { CompareTable } from "./compare_table";
import { begun, type Draft } from "./draft";
import { Editor } from "./editor";
import { SyncStatusCard } from "./sync_status_card";
import { TwinHistory } from "./twin_history";
import "../styles/admin.css";
import "../styles/ops.css";

const LOOK_MS = 2000;
const LISTED = 20;

/** Drafts outlive a look at another tab. */
const drafts = new Map<string, Signal<Draft | null>>();

function draftOf(robot: string): Signal<Draft | null> {
  const found = drafts.get(robot) ?? signal<Draft | null>(null);
  drafts.set(robot, found);
  return found;
}

export function ConfigTab({ robot }: { robot: Robot }) {
  const asked = useAsked(() => twinApi.get(robot.id), LOOK_MS);
  const history = useAsked(() => twinApi.history(robot.id, LISTED), 60_000);
  const draft = draftOf(robot.id);
  const twin = asked.value.value;
  const edition = twin?.edition ?? null;
  useEffect(() => {
    if (edition !== null) void history.refresh();
  }, [edition]);
  const refresh = () => asked.refresh();
  if (!twin) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Reading what is desired of the robot…</p>;
  return (
    <div class="ops">
      <Refusal text={asked.problem.value} />
      <SyncStatusCard twin={twin} online={robot.state === "online"} onChanged={refresh} onEdit={can("twin.write") && !draft.value ? () => (draft.value = begun(twin)) : null} />
      {!can("twin.write") && <MayNot what="change what a robot is to be" />}
      {draft.value && (
        <Editor
          twin={twin}
          draft={draft}
          onApplied={async () => {
            draft.value = null;
            scrollTo({ top: 0, behavior: "smooth" });
            await refresh();
          }}
        />
      )}
      <div class="ops-split">
        <CompareTable rows={compare(twin, robot.namespace)} />
        <TwinHistory twin={twin} entries={history.value.value} problem={history.problem.value} onChanged={refresh} />
      </div>
    </div>
  );
}
