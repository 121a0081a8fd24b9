/** The form that has a robot do something: what, now or when it comes, and how long that may take. */

import { useSignal, type Signal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { api } from "../api/client";
import { commandsApi, type Command, type CommandKind } from "../api/commands";
import { newKey } from "../api/exact";
import { can } from "../api/session";
import type { Robot } from "../api/types";
import { writeJson, type JsonObject } from "../values/json";
import { DurableFields } from "./durable_fields";
import { blankForm, formOf, orderOf, type Form } from "./form";
import { KindFields } from "./kind_fields";
import { KINDS } from "./words";

const NEVER_MS = 3_600_000;

interface DialogProps {
  robot: Robot;
  /** Older commands: what was asked before is offered again. */
  known: Command[];
  /** Begin with what this one asked. */
  like: Command | null;
  onClose: () => void;
  onSent: (command: Command) => void;
}

export function SendDialog({ robot, known, like, onClose, onSent }: DialogProps) {
  const kinds = KINDS.filter(({ needs }) => can(needs));
  const form = useSignal<Form>((like && formOf(like)) ?? { ...blankForm(kinds[0]!.kind), durable: robot.state !== "online" });
  const topics = useAsked(() => api.topics(robot.id), NEVER_MS);
  const sent = useRef({ text: "", key: "" });
  const { busy, problem, attempt } = useAttempt();
  const submit = async (close: () => void) => {
    const order = orderOf(form.value);
    const text = writeJson({ ...order } as JsonObject);
    // What is pressed again after a broken connection is the same command; what was changed is another one.
    if (sent.current.text !== text) sent.current = { text, key: newKey() };
    onSent(await commandsApi.send(robot.id, order, sent.current.key));
    close();
  };
  return (
    <Modal title={`A command for ${robot.id}`} onClose={onClose}>
      {(close) => (
        <form
          class="command-form"
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(() => submit(close));
          }}
        >
          <KindField form={form} kinds={kinds.map(({ kind }) => kind)} />
          <KindFields form={form} robot={robot} topics={topics.value.value ?? []} known={known} />
          {form.value.kind !== "save_recording" && <DurableFields form={form} online={robot.state === "online"} />}
          <div class="dialog-foot">
            <Refusal text={problem.value} />
            <div class="dialog-end">
              <span />
              <button type="button" class="button" onClick={close}>Cancel</button>
              <button class="button button-solid" disabled={busy.value}>{busy.value ? "Sending…" : "Send"}</button>
            </div>
          </div>
        </form>
      )}
    </Modal>
  );
}

function KindField({ form, kinds }: { form: Signal<Form>; kinds: CommandKind[] }) {
  return (
    <fieldset>
      <legend class="visually-hidden">What</legend>
      <div class="kinds">
        {KINDS.filter(({ kind }) => kinds.includes(kind)).map(({ kind, word, hint }) => (
          <label key={kind} class="choice">
            <input type="radio" name="kind" value={kind} checked={form.value.kind === kind} onChange={() => (form.value = { ...form.value, kind })} />
            <span><b>{word}</b><small>{hint}</small></span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}
