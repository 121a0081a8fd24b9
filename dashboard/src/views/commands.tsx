/** The Commands tab: the robot's commands, the newest first, and the form that sends one. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Confirm, Refusal, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { saidOf } from "../api/client";
import { commandsApi, type Command, type CommandPage, type CommandState } from "../api/commands";
import { can } from "../api/session";
import type { Robot } from "../api/types";
import { CommandRow } from "../commands/command_row";
import { formOf } from "../commands/form";
import { SendDialog } from "../commands/send_dialog";
import { isOver } from "../commands/steps";
import { titleOf } from "../commands/words";
import { MayNot } from "../ui/parts";
import { place, setParam } from "../ui/url";
import "../styles/admin.css";
import "../styles/commands.css";

const IDLE_MS = 4000;
const BUSY_MS = 1000;
const STATES: readonly (CommandState | "")[] = ["", "issued", "delivered", "running", "done", "failed", "expired", "cancelled"];

export function CommandsTab({ robot }: { robot: Robot }) {
  const asked = place.value.params.get("state") as CommandState | null;
  const state = asked && STATES.includes(asked) ? asked : "";
  return <History key={`${robot.id} ${state}`} robot={robot} state={state} />;
}

function History({ robot, state }: { robot: Robot; state: CommandState | "" }) {
  const busy = useSignal(false);
  const newest = useAsked(() => commandsApi.list(robot.id, state, null), busy.value ? BUSY_MS : IDLE_MS);
  const older = useSignal<CommandPage | null>(null);
  const dialog = useSignal<{ like: Command | null } | null>(null);
  const question = useSignal<Question | null>(null);
  const fresh = useSignal("");
  const page = newest.value.value;
  const shown = page && merged(page, older.value);
  const waits = page?.commands.some((command) => !isOver(command.state)) ?? false;
  useEffect(() => {
    busy.value = waits;
  }, [waits]);
  const more = async () => {
    const from = older.value ?? page;
    if (!from?.next) return;
    try {
      const next = await commandsApi.list(robot.id, state, from.next);
      older.value = { commands: [...from.commands, ...next.commands], next: next.next };
    } catch (error) {
      newest.problem.value = saidOf(error);
    }
  };
  return (
    <div class="admin commands">
      <div class="page-head">
        <label class="command-filter">
          <span>State</span>
          <select value={state} onChange={(event) => setParam("state", event.currentTarget.value)}>
            {STATES.map((one) => <option key={one} value={one}>{one || "all"}</option>)}
          </select>
        </label>
        {can("commands.send") ? (
          <button type="button" class="button button-solid" onClick={() => (dialog.value = { like: null })}>Send a command…</button>
        ) : <MayNot what="send commands" />}
      </div>
      <Refusal text={newest.problem.value} />
      {!shown ? <p class="quiet">Asking the gateway…</p> : shown.commands.length === 0 ? <Nothing state={state} /> : (
        <ol class="command-list" aria-label="Commands, the newest first">
          {shown.commands.map((command) => (
            <CommandRow
              key={command.id}
              command={command}
              fresh={command.id === fresh.value}
              onCancel={command.durable && command.state === "issued" && can("commands.cancel") ? () => (question.value = cancelQuestion(command, newest.refresh)) : undefined}
              onAgain={can("commands.send") && formOf(command) ? () => (dialog.value = { like: command }) : undefined}
            />
          ))}
        </ol>
      )}
      {shown?.next && <p class="command-end"><button type="button" class="button" onClick={() => void more()}>Older ones</button></p>}
      {dialog.value && (
        <SendDialog
          robot={robot}
          known={shown?.commands ?? []}
          like={dialog.value.like}
          onClose={() => (dialog.value = null)}
          onSent={({ id }) => {
            fresh.value = id;
            void newest.refresh();
          }}
        />
      )}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </div>
  );
}

/** The newest page as it is now, before those older ones that it does not hold. */
function merged(newest: CommandPage, older: CommandPage | null): CommandPage {
  if (!older) return newest;
  const held = new Set(newest.commands.map(({ id }) => id));
  return { commands: [...newest.commands, ...older.commands.filter(({ id }) => !held.has(id))], next: older.next };
}

const cancelQuestion = (command: Command, done: () => Promise<void>): Question => ({
  title: "Take the command back?",
  text: <p><b class="wrap">{titleOf(command)}</b> has not left for its robot yet. Taken back, it never will.</p>,
  yes: "Take it back",
  run: async () => {
    await commandsApi.cancel(command.id);
    await done();
  },
});

function Nothing({ state }: { state: string }) {
  if (state) return <p class="nothing">No command of this robot is {state}.</p>;
  return (
    <p class="nothing">
      This robot got no command in the last 30 days. Whatever is published, called or asked of it, from here, by the command line or by a
      program, stands here with who asked, when, and what came of it.
    </p>
  );
}
