/** Publish one message on a topic of the robot: written as its type has it, or begun with the newest message there. */

import { useSignal } from "@preact/signals";
import { Refusal, useAttempt } from "../admin/modal";
import { introspectApi } from "../api/introspect";
import { can } from "../api/session";
import type { Robot, Topic } from "../api/types";
import { clockTime, integer } from "../ui/format";
import { MayNot } from "../ui/parts";
import { DraftFields, useDraft } from "./draft";

/** What moves a robot: the gateway takes it under the lease of a drive pad alone. */
const ACTUATOR = /(^|\/)cmd_vel$/;

export function PublishForm({ robot, topic: { topic, type } }: { robot: Robot; topic: Topic }) {
  const draft = useDraft(robot.id, type, "message");
  const said = useSignal("");
  const count = useSignal(0);
  const { busy, problem, attempt } = useAttempt();
  const submit = () =>
    attempt(async () => {
      await introspectApi.publish(robot.id, topic, type, draft.value.peek());
      count.value += 1;
      said.value = `${integer(count.value)} published, the last at ${clockTime(Date.now())}`;
    });
  if (!can("robots.publish")) return <MayNot what="publish" />;
  if (ACTUATOR.test(topic)) return <p class="hint">This topic moves the robot. It is published by the drive pad on the Live tab alone, while somebody holds it.</p>;
  return (
    <form class="message-form" onSubmit={(event) => { event.preventDefault(); void submit(); }}>
      <DraftFields draft={draft} part="message" />
      <Refusal text={problem.value} />
      <div class="message-end">
        <span class="hint" role="status">{said.value || (robot.state === "online" ? "" : "The robot is offline.")}</span>
        <button class="button button-solid" disabled={busy.value || !draft.shape.value || draft.invalid.value.size > 0}>{busy.value ? "Publishing…" : "Publish"}</button>
      </div>
    </form>
  );
}
