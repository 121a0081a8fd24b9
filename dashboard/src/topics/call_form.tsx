/** Call a service of the robot: the request as its type has it, the answer as a tree. */

import { useSignal } from "@preact/signals";
import { Refusal, useAttempt } from "../admin/modal";
import { introspectApi } from "../api/introspect";
import { can } from "../api/session";
import type { Robot } from "../api/types";
import { MayNot } from "../ui/parts";
import type { JsonObject } from "../values/json";
import { writeJson } from "../values/json";
import { DraftFields, useDraft } from "./draft";

const TIMEOUT_S = 10;

interface Answer {
  response: JsonObject;
  tookMs: number;
}

export function CallForm({ robot, service, type }: { robot: Robot; service: string; type: string }) {
  const draft = useDraft(robot.id, type, "request");
  const answer = useSignal<Answer | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const submit = () =>
    attempt(async () => {
      answer.value = null;
      const began = performance.now();
      const response = await introspectApi.call(robot.id, service, type, draft.value.peek(), TIMEOUT_S);
      answer.value = { response, tookMs: performance.now() - began };
    });
  if (!can("robots.call")) return <MayNot what="call services" />;
  return (
    <form class="message-form" data-call={service} onSubmit={(event) => { event.preventDefault(); void submit(); }}>
      <DraftFields draft={draft} part="request" />
      <Refusal text={problem.value} />
      <div class="message-end">
        <span class="hint" role="status">{answer.value ? `It answered after ${Math.round(answer.value.tookMs)}\u202fms.` : ""}</span>
        <button class="button button-solid" disabled={busy.value || !draft.shape.value || draft.invalid.value.size > 0}>{busy.value ? "Calling…" : "Call"}</button>
      </div>
      {answer.value && <pre class="message-answer" aria-label="Answer">{writeJson(answer.value.response, 2)}</pre>}
    </form>
  );
}
