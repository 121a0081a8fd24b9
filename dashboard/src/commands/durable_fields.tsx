/** Now, or whenever the robot is there: until when it may come, and how long it may take. */

import type { Signal } from "@preact/signals";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import type { Form } from "./form";
import { EXPIRIES } from "./words";

export function DurableFields({ form, online }: { form: Signal<Form>; online: boolean }) {
  const { durable, expiresS, timeoutS } = form.value;
  const set = (change: Partial<Form>) => (form.value = { ...form.value, ...change });
  return (
    <>
      <SegmentedControl
        label="When"
        choices={[["now", "Now"], ["durable", "When the robot is there"]]}
        chosen={durable ? "durable" : "now"}
        onChoose={(when) => set({ durable: when === "durable" })}
      />
      {durable ? (
        <>
          <SegmentedControl label="It expires after" choices={EXPIRIES.map(([word, seconds]) => [seconds, word])} chosen={expiresS} onChoose={(seconds) => set({ expiresS: seconds })} />
          <p class="hint">The robot runs it at most once, whatever restarts meanwhile, and never after its expiry.</p>
        </>
      ) : (
        !online && <p class="hint warn">The robot is offline: sent now, it fails at once.</p>
      )}
      <TextField label="Time-out" note="s, once it runs" value={timeoutS} onInput={(text) => set({ timeoutS: text })} />
    </>
  );
}
