/** For how long: an hour, a working day, or as many hours as one likes. */

import { useSignal } from "@preact/signals";
import { SegmentedControl } from "../../admin/segmented_control";

export const USUAL_LENGTH = 3600;
const LENGTHS: readonly (readonly [number, string])[] = [[3600, "1 h"], [28_800, "8 h"], [86_400, "1 d"], [0, "other"]];
const MOST_H = 8760;

/** `seconds` is NaN while the hours that are typed are none. */
export function LengthField({ seconds, onChange }: { seconds: number; onChange: (seconds: number) => void }) {
  const other = useSignal("");
  const isOther = useSignal(false);
  const typed = (text: string) => {
    other.value = text;
    const hours = Number(text);
    onChange(hours > 0 && hours <= MOST_H ? Math.round(hours * 3600) : NaN);
  };
  return (
    <div class="length-field">
      <SegmentedControl
        label="For"
        choices={LENGTHS}
        chosen={isOther.value ? 0 : seconds}
        onChoose={(value) => {
          isOther.value = value === 0;
          if (value > 0) onChange(value);
          else typed(other.value || "2");
        }}
      />
      {isOther.value && (
        <label class="field">
          <span>Hours</span>
          <input class="text" inputMode="decimal" autoComplete="off" size={6} value={other.value} aria-invalid={Number.isNaN(seconds)} onInput={(event) => typed(event.currentTarget.value)} />
        </label>
      )}
    </div>
  );
}
