/** Dialogs of the Admin page: one that holds a form, and one that asks before something is taken away. */

import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { saidOf } from "../api/client";
import { TextField } from "./fields";

/** Open while it is on the page. Escape, or `close` of its children, ends it and gives the focus back. */
export function Modal({ title, onClose, children }: { title: string; onClose: () => void; children: (close: () => void) => ComponentChildren }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const id = useId();
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog ref={dialog} class="admin-dialog" aria-labelledby={id} onClose={onClose}>
      <h2 id={id}>{title}</h2>
      {children(() => dialog.current?.close())}
    </dialog>
  );
}

/** Runs something that the gateway may refuse, once at a time: its words are in `problem` then. */
export function useAttempt() {
  const busy = useSignal(false);
  const problem = useSignal("");
  const attempt = async (work: () => Promise<void>) => {
    if (busy.peek()) return;
    busy.value = true;
    problem.value = "";
    try {
      await work();
    } catch (error) {
      problem.value = saidOf(error);
    }
    busy.value = false;
  };
  return { busy, problem, attempt };
}

/** What the gateway said when it refused. */
export const Refusal = ({ text }: { text: string }) => (text ? <p class="refusal" role="alert">{text}</p> : null);

export interface Question {
  title: string;
  /** What will happen. */
  text: ComponentChildren;
  /** The button's word. */
  yes: string;
  /** Asks for a reason with this label, which `run` gets. */
  reason?: string;
  run: (reason: string) => Promise<unknown>;
}

export function Confirm({ question, onClose }: { question: Question; onClose: () => void }) {
  const { busy, problem, attempt } = useAttempt();
  const reason = useSignal("");
  return (
    <Modal title={question.title} onClose={onClose}>
      {(close) => (
        <form
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(async () => {
              await question.run(reason.value.trim());
              close();
            });
          }}
        >
          <div class="prose">{question.text}</div>
          {question.reason && (
            <TextField label={question.reason} most={200} focus value={reason.value} onInput={(text) => (reason.value = text)} />
          )}
          <Refusal text={problem.value} />
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Cancel</button>
            <button class="button button-danger" disabled={busy.value}>{question.yes}</button>
          </div>
        </form>
      )}
    </Modal>
  );
}
