/** A schedule while it is written: its expression, its zone, what of missed times, and when it would be next. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import { saidOf } from "../api/client";
import { rulesApi } from "../api/rules";
import { now } from "../live/age";
import type { JsonObject } from "../values/json";
import { faultAt, withPlace } from "./document";
import type { FormProps } from "./form_props";
import { fieldText } from "./target_fields";
import { inText, inZone } from "./times";

const TYPING_MS = 350;
const COUNT = 5;
const MISFIRES: readonly (readonly [string, string])[] = [["skip", "skip them"], ["once", "fire once"], ["all", "fire each"]];
const ZONES = ["UTC", "Europe/Berlin", "Europe/Paris", "Europe/London", "America/New_York", "America/Los_Angeles", "Asia/Tokyo", "Asia/Shanghai"];

export function ScheduleFields({ document, faults, onChange }: FormProps) {
  const schedule = document.schedule as JsonObject;
  const expression = fieldText(schedule.expression);
  const zone = fieldText(schedule.timezone) || "UTC";
  const set = (key: string, value: string) => onChange(withPlace(document, ["schedule", key], value));
  return (
    <>
      <div class="check-fields">
        <TextField label="Schedule" mono hint="rate(5 minutes), cron(0 3 * * ? *), at(2027-01-01T09:00:00)" value={expression} problem={faultAt(faults, "schedule.expression")} onInput={(text) => set("expression", text)} />
        <TextField label="Time zone" mono options={ZONES} value={fieldText(schedule.timezone)} problem={faultAt(faults, "schedule.timezone")} onInput={(text) => set("timezone", text)} />
      </div>
      <SegmentedControl label="Times that were missed" choices={MISFIRES} chosen={fieldText(schedule.misfire) || "skip"} onChoose={(chosen) => set("misfire", chosen)} />
      <NextTimes expression={expression} zone={zone} />
    </>
  );
}

export function NextTimes({ expression, zone }: { expression: string; zone: string }) {
  const times = useSignal<string[] | null>(null);
  const problem = useSignal("");
  useEffect(() => {
    let gone = false;
    const timer = setTimeout(() => {
      rulesApi.preview(expression, zone, COUNT).then(
        (found) => {
          if (gone) return;
          times.value = found;
          problem.value = "";
        },
        (error: unknown) => {
          if (gone) return;
          times.value = null;
          problem.value = saidOf(error);
        },
      );
    }, TYPING_MS);
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [expression, zone]);
  return (
    <div class="next-times" data-times={times.value?.length ?? ""}>
      {problem.value ? <p class="bad" role="alert">{problem.value}</p> : times.value === null ? <p class="hint">…</p> : times.value.length === 0 ? <p class="hint">It never fires again.</p> : (
        <ol aria-label={`Next times in ${zone}`}>{times.value.map((iso) => <li key={iso} class="num"><b>{inZone(iso, zone)}</b> <small>{zone} · {inText(iso, now.value)}</small></li>)}</ol>
      )}
    </div>
  );
}
