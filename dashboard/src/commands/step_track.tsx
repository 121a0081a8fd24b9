/** A command's steps as dots on a line, each with its word and its time. */

import type { Command } from "../api/commands";
import { clockTime } from "../ui/format";
import { stepsOf, type StepStatus, type Step } from "./steps";

const DISC = "M6 1a5 5 0 1 1 0 10A5 5 0 0 1 6 1Z";
const RING = `${DISC}m0 1.600a3.400 3.400 0 1 0 0 6.800 3.400 3.400 0 0 0 0-6.800Z`;
const SHAPES: Record<StepStatus, string> = {
  there: DISC,
  untold: "M6 3.800a2.200 2.200 0 1 1 0 4.400 2.200 2.200 0 0 1 0-4.400Z",
  next: RING,
  ahead: RING,
  missed: "M2 5.200h8v1.600H2Z",
};
const ENDS = {
  good: DISC,
  bad: "M1.500 3 3 1.500 6 4.500 9 1.500 10.500 3 7.500 6l3 3L9 10.500l-3-3-3 3L1.500 9l3-3Z",
  off: "M1.500 1.500h9v9h-9Zm2 2v5h5v-5Z",
};
const SAID: Record<StepStatus, string> = { there: "", untold: "went through", next: "awaited", ahead: "to come", missed: "did not come to it" };

export function StepTrack({ command }: { command: Command }) {
  return (
    <ol class="steps" aria-label="How far it is">
      {stepsOf(command).map((step, i) => (
        <li key={i} class={`step step-${step.status}`} data-step={step.word} data-standing={step.status} data-end={step.end ?? undefined} title={step.stamp ?? undefined}>
          <svg viewBox="0 0 12 12" aria-hidden="true"><path d={step.end ? ENDS[step.end] : SHAPES[step.status]} fill-rule="evenodd" /></svg>
          <b>{step.word}</b>
          <Moment step={step} first={i === 0} />
        </li>
      ))}
    </ol>
  );
}

/** When the first step was; how long after the one before each other was. */
function Moment({ step: { status, stamp, took }, first }: { step: Step; first: boolean }) {
  if (status !== "there") return <span class={status === "next" ? "step-said" : "visually-hidden"}>{SAID[status]}</span>;
  if (first || !took) return <span class="num">{stamp && clockTime(Date.parse(stamp))}</span>;
  return <span class="num">+{took}</span>;
}
