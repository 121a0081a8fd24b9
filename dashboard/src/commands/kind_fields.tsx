/** The fields of each kind of command; what is known of the robot is offered while one types. */

import type { Signal } from "@preact/signals";
import { useId } from "preact/hooks";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import { useAsked } from "../admin/use_list";
import { request, robotPath } from "../api/client";
import type { Command } from "../api/commands";
import type { Robot, Topic } from "../api/types";
import type { Form } from "./form";
import { fieldOf, SIGNALS } from "./words";

interface FieldsProps {
  form: Signal<Form>;
  robot: Robot;
  topics: Topic[];
  known: Command[];
}

export function KindFields({ form, robot, topics, known }: FieldsProps) {
  const set = (change: Partial<Form>) => (form.value = { ...form.value, ...change });
  switch (form.value.kind) {
    case "publish":
      return <PublishFields form={form.value} set={set} robot={robot} topics={topics} />;
    case "call_service":
      return <CallFields form={form.value} set={set} robot={robot} known={known} />;
    case "node_verb":
      return <NodeFields form={form.value} set={set} robot={robot} />;
    case "save_recording":
      return <RecordingFields form={form.value} set={set} />;
    default:
      return <TextField label="At most" note="kB/s" hint="Empty: no limit." placeholder="no limit" value={form.value.limit} onInput={(limit) => set({ limit })} focus />;
  }
}

interface Part {
  form: Form;
  set: (change: Partial<Form>) => void;
}

function PublishFields({ form, set, robot, topics }: Part & { robot: Robot; topics: Topic[] }) {
  const chosen = topics.find(({ topic }) => topic === form.topic);
  return (
    <>
      <TextField
        label="Topic" mono required focus placeholder={`${robot.namespace.replace(/\/$/, "")}/…`} options={topics.map(({ topic }) => topic)}
        value={form.topic}
        onInput={(topic) => set({ topic, type: topics.find((one) => one.topic === topic)?.type ?? form.type })}
      />
      <TextField label="Type" mono hint={chosen ? undefined : "As std_msgs/msg/String; empty for a topic that the robot has."} value={form.type} onInput={(type) => set({ type })} />
      <JsonField label="Message" value={form.message} onInput={(message) => set({ message })} />
      {/(^|\/)cmd_vel$/.test(form.topic) && <p class="hint">What moves the robot goes by the drive pad alone: the robot refuses it from here.</p>}
    </>
  );
}

function CallFields({ form, set, robot, known }: Part & { robot: Robot; known: Command[] }) {
  const called = new Map(known.filter(({ kind }) => kind === "call_service").map((one) => [fieldOf(one.request, "service"), fieldOf(one.request, "type")]));
  const types = new Map([[`${robot.namespace.replace(/\/$/, "")}/base/resume`, "std_srvs/srv/Trigger"], ...called]);
  return (
    <>
      <TextField
        label="Service" mono required focus placeholder={`${robot.namespace.replace(/\/$/, "")}/…`} options={[...types.keys()]}
        value={form.service}
        onInput={(service) => set({ service, serviceType: types.get(service) ?? form.serviceType })}
      />
      <TextField label="Type" mono required placeholder="std_srvs/srv/Trigger" value={form.serviceType} onInput={(serviceType) => set({ serviceType })} />
      <JsonField label="Request" value={form.request} onInput={(text) => set({ request: text })} />
    </>
  );
}

const VERB_WORDS: readonly [string, string][] = [
  ["restart", "Restart"],
  ["start", "Start"],
  ["stop", "Stop"],
  ["retry", "Retry"],
  ["signal", "Signal"],
];
const NEVER_MS = 3_600_000;

function NodeFields({ form, set, robot }: Part & { robot: Robot }) {
  const asked = useAsked(() => request<{ reported: { values?: { nodes?: object } } | null }>(`${robotPath(robot.id)}/twin`), NEVER_MS);
  const nodes = Object.keys(asked.value.value?.reported?.values?.nodes ?? {});
  return (
    <>
      <TextField label="Node" mono required focus options={nodes} hint={nodes.length > 0 ? undefined : "Its name in the robot's table of nodes."} value={form.node} onInput={(node) => set({ node })} />
      <SegmentedControl label="What" choices={VERB_WORDS} chosen={form.verb} onChoose={(verb) => set({ verb })} />
      {form.verb === "signal" && <SegmentedControl label="Signal" choices={SIGNALS.map(([word, number]) => [number, word])} chosen={form.signal} onChoose={(signal) => set({ signal })} />}
      {(form.verb === "start" || form.verb === "stop") && <p class="hint">Until the robot's twin or a restart says otherwise. On the Nodes tab it is for good.</p>}
    </>
  );
}

const SPANS: readonly [number, string][] = [
  [30, "30 s"],
  [60, "1 min"],
  [300, "5 min"],
  [900, "15 min"],
];

function RecordingFields({ form, set }: Part) {
  return (
    <>
      <SegmentedControl label="The last" choices={SPANS} chosen={form.lastS} onChoose={(lastS) => set({ lastS })} />
      <TextField label="Topics" mono placeholder="all" hint="Patterns with * and **, between commas. The clip waits for its robot by itself, for a day." value={form.topics} onInput={(topics) => set({ topics })} />
    </>
  );
}

function JsonField({ label, value, onInput }: { label: string; value: string; onInput: (text: string) => void }) {
  const id = useId();
  return (
    <div class="field">
      <span><label for={id}>{label}</label> <small>JSON</small></span>
      <textarea id={id} class="text mono" rows={Math.min(14, Math.max(4, value.split("\n").length))} autoCapitalize="none" spellcheck={false} value={value} onInput={(event) => onInput(event.currentTarget.value)} />
    </div>
  );
}
