/** People: who they are, what they may do, which robots they see, and how they get in. */

import { useSignal } from "@preact/signals";
import { adminApi, type SignInLink, type User } from "../api/admin";
import { session } from "../api/session";
import { now } from "../live/age";
import { agoText, robotsWords, waysIn } from "./accounts";
import { Badge } from "./badge";
import { Confirm, Refusal, useAttempt, type Question } from "./modal";
import { useAsked } from "./use_list";
import { LinkDialog, UserDialog } from "./user_dialog";

const EVERY_MS = 10_000;

export function UsersPart() {
  const asked = useAsked(adminApi.users, EVERY_MS);
  const editing = useSignal<User | "new" | null>(null);
  const link = useSignal<SignInLink | null>(null);
  const question = useSignal<Question | null>(null);
  const { problem, attempt } = useAttempt();
  const users = asked.value.value;
  const makeLink = (user: User) => void attempt(async () => void (link.value = await adminApi.makeLink(user.name)));
  const enable = (user: User) =>
    void attempt(async () => {
      await adminApi.changeUser(user.name, { disabled: false });
      await asked.refresh();
    });
  return (
    <>
      <div class="section-head">
        <h2>Users</h2>
        <button type="button" class="button button-solid" onClick={() => (editing.value = "new")}>Add a user</button>
      </div>
      <Refusal text={problem.value || asked.problem.value} />
      {users === null ? <p class="quiet">Asking the gateway…</p> : users.length === 0 ? <NoUsers /> : (
        <table class="admin-table users">
          <thead>
            <tr>
              <th scope="col">Name</th>
              <th scope="col">Role</th>
              <th scope="col">Robots</th>
              <th scope="col">Last sign-in</th>
              <th scope="col">Signs in by</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {users.map((user) => (
              <UserRow
                key={user.id}
                user={user}
                onLink={() => makeLink(user)}
                onChange={() => (editing.value = user)}
                onEnable={() => enable(user)}
                onDisable={() => (question.value = disableQuestion(user, asked.refresh))}
                onDelete={() => (question.value = deleteQuestion(user, asked.refresh))}
              />
            ))}
          </tbody>
        </table>
      )}
      {editing.value && (
        <UserDialog
          user={editing.value === "new" ? null : editing.value}
          onClose={() => (editing.value = null)}
          onDone={asked.refresh}
          onLink={(made) => (link.value = made)}
        />
      )}
      {link.value && editing.value === null && <LinkDialog link={link.value} onClose={() => (link.value = null)} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </>
  );
}

const disableQuestion = ({ name }: User, done: () => Promise<void>): Question => ({
  title: `Disable ${name}?`,
  text: <p>{name} is signed out everywhere within seconds, and their keys stop working, until you enable them again.</p>,
  yes: "Disable",
  run: async () => {
    await adminApi.changeUser(name, { disabled: true });
    await done();
  },
});

const deleteQuestion = ({ name }: User, done: () => Promise<void>): Question => ({
  title: `Delete ${name}?`,
  text: <p>{name}, their sessions and their keys are gone for good. What they did stays in the audit log.</p>,
  yes: "Delete",
  run: async () => {
    await adminApi.deleteUser(name);
    await done();
  },
});

function NoUsers() {
  return (
    <p class="nothing">
      Nobody has an account yet. Add the people who shall see or drive robots; the first admin you add can sign in from anywhere, so that
      the gateway need not stay on this machine alone.
    </p>
  );
}

interface UserRowProps {
  user: User;
  onLink: () => void;
  onChange: () => void;
  onEnable: () => void;
  onDisable: () => void;
  onDelete: () => void;
}

function UserRow({ user, onLink, onChange, onEnable, onDisable, onDelete }: UserRowProps) {
  const { name, role, robots, disabled, external, signed_in: signedIn } = user;
  const self = session.value?.kind === "user" && session.value.id === user.id;
  return (
    <tr data-user={name} data-disabled={disabled}>
      <td class="cell-name">
        <b>{name}</b>{self && <small> you</small>}
        {disabled && <span class="sub"><Badge tone="off">disabled</Badge></span>}
      </td>
      <td data-label="Role"><span class={`chip role-${role}`}>{role}</span></td>
      <td class="cell-wide mono-list" data-label="Robots">{robotsWords(robots)}</td>
      <td class="num" data-label="Last sign-in" title={signedIn ?? undefined}>{agoText(signedIn, now.value)}</td>
      <td data-label="Signs in by">{waysIn(user)}</td>
      <td class="end cell-actions">
        {!external && !disabled && <button type="button" class="button" aria-label={`Sign-in link for ${name}`} onClick={onLink}>Sign-in link</button>}
        <button type="button" class="button" aria-label={`Change ${name}`} onClick={onChange}>Change…</button>
        {disabled ? (
          <button type="button" class="button" aria-label={`Enable ${name}`} onClick={onEnable}>Enable</button>
        ) : (
          <button type="button" class="button" aria-label={`Disable ${name}`} onClick={onDisable}>Disable…</button>
        )}
        <button type="button" class="button" aria-label={`Delete ${name}`} onClick={onDelete}>Delete…</button>
      </td>
    </tr>
  );
}
