/** Begin a goal of a robot's action: the goal as its type has it, then how it goes, and what it gave. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Refusal, useAttempt } from "../admin/modal";
import { ApiError } from "../api/client";
import { newKey } from "../api/exact";
import { introspectApi, type Goal } from "../api/introspect";
import { can } from "../api/session";
import type { Robot } from "../api/types";
import { MayNot } from "../ui/parts";
import { readJson, writeJson, type JsonObject } from "../values/json";
import { DraftFields, useDraft } from "./draft";

const TIMEOUT_S = 10;

/** Whether a goal that was answered so may have begun all the same: sent again, it is to be the same one. */
const mayHaveBegun = (error: unknown) => error instanceof ApiError && (error.status === 0 || error.status >= 500 || error.code === "idempotency_conflict");

/** What was told last of a goal. */
interface GoalProgress {
  status: Goal["status"];
  message: string;
  feedback: JsonObject | null;
  count: number;
  result: JsonObject | null;
  ended: boolean;
}

type Told = { status: Goal["status"]; message: string; feedback?: JsonObject | null; result?: JsonObject | null };

export function GoalForm({ robot, action, type }: { robot: Robot; action: string; type: string }) {
  const draft = useDraft(robot.id, type, "goal");
  const goal = useSignal("");
  const progress = useSignal<GoalProgress | null>(null);
  const open = useRef({ text: "", key: "" }); // what was sent and has no answer yet
  const { busy, problem, attempt } = useAttempt();
  useEffect(() => {
    if (!goal.value) return;
    const source = new EventSource(introspectApi.goalUrl(robot.id, goal.value)); // a lost one comes back by itself, and begins with how it stands
    const hear = (kind: "status" | "feedback" | "result") => ({ data }: MessageEvent<string>) => {
      const before = progress.peek();
      const told = readJson(data) as unknown as Told;
      if (!before) return;
      const { status, message } = told;
      progress.value = { ...before, status, message, feedback: told.feedback ?? before.feedback, count: before.count + Number(kind === "feedback"), result: told.result ?? null, ended: kind === "result" };
      if (kind === "result") source.close();
    };
    for (const kind of ["status", "feedback", "result"] as const) source.addEventListener(kind, hear(kind));
    const lost = (why: string) => {
      const before = progress.peek();
      source.close();
      if (before && !before.ended) progress.value = { ...before, status: "lost", message: why, ended: true };
    };
    source.addEventListener("end", ({ data }: MessageEvent<string>) => lost((readJson(data) as { message: string }).message));
    source.addEventListener("error", () => source.readyState === EventSource.CLOSED && lost("the gateway does not know of it any more"));
    return () => source.close();
  }, [robot.id, goal.value]);
  const send = async (asked: JsonObject) => {
    const text = writeJson(asked);
    const again = open.current.text === text;
    const { key } = (open.current = again ? open.current : { text, key: newKey() });
    try {
      const begun = await introspectApi.beginGoal(robot.id, action, type, asked, TIMEOUT_S, key);
      open.current = { text: "", key: "" };
      return begun;
    } catch (error) {
      if (!mayHaveBegun(error)) open.current = { text: "", key: "" };
      if (again && error instanceof ApiError && error.code === "unknown_goal") throw new Error("Nothing is known of the goal that was sent before. Sent again, it is another one.");
      throw error;
    }
  };
  const submit = () =>
    attempt(async () => {
      goal.value = "";
      progress.value = null;
      const begun = await send(draft.value.peek());
      progress.value = { status: begun.status, message: "", feedback: null, count: 0, result: null, ended: false };
      goal.value = begun.goal;
    });
  const cancel = () =>
    attempt(async () => {
      if (!(await introspectApi.cancelGoal(robot.id, goal.peek())) && !progress.peek()?.ended) throw new Error("Its server does not stop it.");
    });
  if (!can("robots.call")) return <MayNot what="begin goals" />;
  const now = progress.value;
  const under = now !== null && !now.ended;
  return (
    <form class="message-form" data-goal={action} onSubmit={(event) => { event.preventDefault(); if (!under) void submit(); }}>
      <DraftFields draft={draft} part="goal" />
      <Refusal text={problem.value} />
      <div class="message-end">
        {now && <GoalLine progress={now} />}
        {under && <button type="button" class="button" disabled={busy.value || now.status === "canceling"} onClick={() => void cancel()}>Cancel goal</button>}
        <button class="button button-solid" onClick={(event) => event.detail > 1 && event.preventDefault()} disabled={busy.value || under || !draft.shape.value || draft.invalid.value.size > 0}>{busy.value && !under ? "Sending…" : under ? "Under way…" : "Send goal"}</button>
      </div>
      {now?.feedback && !now.result && <pre class="message-answer goal-feedback" aria-label="Feedback">{writeJson(now.feedback, 2)}</pre>}
      {now?.result && <pre class="message-answer" data-status={now.status} aria-label="Result">{writeJson(now.result, 2)}</pre>}
    </form>
  );
}

function GoalLine({ progress: { status, message, count, ended } }: { progress: GoalProgress }) {
  const heard = count > 0 ? ` · ${count} ${count === 1 ? "message" : "messages"} of feedback` : "";
  return (
    <span class="goal-line" role="status" data-status={status}>
      {!ended && <progress aria-label="Under way" />}
      <span><b>{status}</b>{heard}{message && ` · ${message}`}</span>
    </span>
  );
}
