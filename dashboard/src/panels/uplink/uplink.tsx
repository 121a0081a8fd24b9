/** The byte budget of a robot: a slider that takes effect when it is let go, and how much of it is used. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { ApiError } from "../../api/client";
import { robotApi } from "../../api/robot";
import { can } from "../../api/session";
import type { Robot } from "../../api/types";
import { bytesPerSecond } from "../../ui/format";
import { Card, MayNot } from "../../ui/parts";
import { STEPS, stepOf } from "./uplink_steps";

const said = (bytesPerS: number | null) => (bytesPerS === null ? "No limit" : bytesPerSecond(bytesPerS));

export function UplinkCard({ robot }: { robot: Robot }) {
  const { budget_bytes_per_s: limit, sent_bytes_per_s: sent } = robot.link;
  const chosen = useSignal<number | null>(null); // a step that is being dragged, or on its way
  const state = useSignal<"" | "setting" | "refused">("");
  const problem = useSignal("");
  const online = robot.state === "online";
  const may = can("robots.configure");
  useEffect(() => {
    if (state.value === "") chosen.value = null;
  }, [limit]);
  const shown = chosen.value === null ? limit : STEPS[chosen.value]!;
  const set = async (step: number) => {
    chosen.value = step;
    state.value = "setting";
    try {
      await robotApi.setUplink(robot.id, STEPS[step]!);
      state.value = "";
    } catch (error) {
      state.value = "refused";
      problem.value = error instanceof ApiError ? error.message : String(error);
      chosen.value = null;
    }
  };
  const used = shown === null ? 0 : Math.min(1, sent / shown);
  return (
    <Card title="Uplink" kind="uplink" note={online ? `${bytesPerSecond(sent)} now` : ""}>
      <div class="uplink" data-limit={limit ?? "none"} data-state={state.value || "set"}>
        <p class="big">
          {said(shown)} <span class="uplink-state">{feedback(online, state.value, chosen.value !== null, problem.value)}</span>
        </p>
        <input
          type="range"
          aria-label="Byte budget of the uplink"
          aria-valuetext={said(shown)}
          min={0}
          max={STEPS.length - 1}
          step={1}
          disabled={!may || !online || state.value === "setting"}
          value={chosen.value ?? stepOf(limit)}
          onInput={(event) => {
            state.value = "";
            chosen.value = event.currentTarget.valueAsNumber;
          }}
          onChange={(event) => void set(event.currentTarget.valueAsNumber)}
        />
        <p class="scale" aria-hidden="true"><span>{said(STEPS[0]!)}</span><span>no limit</span></p>
        <div class="meter" aria-hidden="true"><i style={{ transform: `scaleX(${used})` }} /></div>
        {!may && <MayNot what="set it" />}
        <p class="hint">
          {shown === null
            ? "The robot sends what there is to send; history still leaves 30 % of the link free."
            : `${Math.round(used * 100)} % of it is used. Events go first, then live, metrics, bulk; history last.`}
        </p>
      </div>
    </Card>
  );
}

function feedback(online: boolean, state: string, dragged: boolean, problem: string) {
  if (!online) return "the robot is offline";
  if (state === "setting") return "telling the robot…";
  if (state === "refused") return <b class="bad" role="alert">{problem}</b>;
  return dragged ? "let go to set" : "";
}
