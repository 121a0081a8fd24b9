/** Keep a minute of the robot's black box: the last one, or while looking at the past the one around the instant. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { saidOf } from "../../api/client";
import { recordingsApi } from "../../api/recordings";
import { Link } from "../../ui/parts";

export const SAVED_S = 60;
const SAID_MS = 8000;

export function SaveButton({ robot, tMs }: { robot: string; tMs: number | null }) {
  const state = useSignal<"" | "asking" | "asked" | "refused">("");
  const problem = useSignal("");
  useEffect(() => {
    if (state.value !== "asked" && state.value !== "refused") return;
    const timer = setTimeout(() => (state.value = ""), SAID_MS);
    return () => clearTimeout(timer);
  }, [state.value]);
  const save = async () => {
    state.value = "asking";
    try {
      if (tMs === null) await recordingsApi.saveLast(robot, SAVED_S);
      else await recordingsApi.save(robot, tMs - (SAVED_S * 1000) / 2, Math.min(Date.now(), tMs + (SAVED_S * 1000) / 2));
      state.value = "asked";
    } catch (error) {
      problem.value = saidOf(error);
      state.value = "refused";
    }
  };
  return (
    <span class="save" data-save={state.value || "idle"}>
      <span class="save-said" role="status">
        {state.value === "asked" && <Link href="/recordings">asked for</Link>}
        {state.value === "refused" && <span class="bad">{problem.value}</span>}
      </span>
      <button
        type="button"
        class="button"
        disabled={state.value === "asking"}
        title="Full rate, from the robot's black box"
        onClick={() => void save()}
      >
        <i class="dot" aria-hidden="true" /> {tMs === null ? "Save last 60 s" : "Save 60 s here"}
      </button>
    </span>
  );
}
