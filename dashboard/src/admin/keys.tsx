/** Keys of programs: one's own, and for admins everybody's. */

import { useSignal } from "@preact/signals";
import { adminApi, type ApiKey } from "../api/admin";
import { can, session } from "../api/session";
import { now } from "../live/age";
import { agoText, keyLife, robotsWords } from "./accounts";
import { Badge } from "./badge";
import { KeyDialog } from "./key_dialog";
import { Confirm, Refusal, type Question } from "./modal";
import { useAsked } from "./use_list";

const EVERY_MS = 10_000;

export function KeysPart() {
  const asked = useAsked(adminApi.keys, EVERY_MS);
  const making = useSignal(false);
  const question = useSignal<Question | null>(null);
  const keys = asked.value.value;
  const all = can("keys.manage");
  return (
    <>
      <div class="section-head">
        <h2>{all ? "Keys of everybody" : "My keys"}</h2>
        <button type="button" class="button button-solid" onClick={() => (making.value = true)}>Make a key</button>
      </div>
      <Refusal text={asked.problem.value} />
      {keys === null ? <p class="quiet">Asking the gateway…</p> : keys.length === 0 ? (
        <p class="nothing">
          No keys yet. A program, a script or a wall display signs in with a key of its own instead of your password: with its own role and
          end, and gone when you revoke it.
        </p>
      ) : (
        <table class="admin-table keys">
          <thead>
            <tr>
              <th scope="col">Name</th>
              {all && <th scope="col">Whose</th>}
              <th scope="col">Role</th>
              <th scope="col">Robots</th>
              <th scope="col">Last used</th>
              <th scope="col">Ends</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {keys.map((key) => (
              <KeyRow key={key.id} one={key} whose={all} onRevoke={() => (question.value = revokeQuestion(key, asked.refresh))} />
            ))}
          </tbody>
        </table>
      )}
      {keys && keys.length > 0 && <p class="hint under">“Last used” is exact to five minutes.</p>}
      {making.value && <KeyDialog onClose={() => (making.value = false)} onDone={asked.refresh} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </>
  );
}

const revokeQuestion = ({ id, name }: ApiKey, done: () => Promise<void>): Question => ({
  title: `Revoke the key ${name}?`,
  text: <p>Whatever uses it is refused from now on, and what is connected by it is cut within seconds. This cannot be taken back.</p>,
  yes: "Revoke",
  run: async () => {
    await adminApi.revokeKey(id);
    await done();
  },
});

function KeyRow({ one, whose, onRevoke }: { one: ApiKey; whose: boolean; onRevoke: () => void }) {
  const life = keyLife(one, now.value);
  const own = session.value?.kind === "user" && session.value.name === one.user;
  return (
    <tr data-key={one.id} data-over={life.over}>
      <td class="cell-name">
        <b class="wrap">{one.name}</b>
        <span class="sub mono">{one.id}</span>
      </td>
      {whose && <td data-label="Whose">{one.user ? <>{one.user}{own && <small> you</small>}</> : <span class="none" title="Made on the gateway's machine, or by another key">nobody's</span>}</td>}
      <td data-label="Role">
        <span class={`chip role-${one.role}`}>{one.role}</span>
        {one.scopes.map((scope) => <span key={scope} class="chip">{scope}</span>)}
      </td>
      <td class="cell-wide mono-list" data-label="Robots">{robotsWords(one.robots)}</td>
      <td class="num" data-label="Last used" title={one.used ?? undefined}>{agoText(one.used, now.value)}</td>
      <td class="num" data-label="Ends" title={one.expires ?? undefined}>
        {life.over ? <Badge tone="off">{life.text}</Badge> : life.soon ? <Badge tone="warn">{life.text}</Badge> : life.text}
      </td>
      <td class="end cell-actions"><button type="button" class="button" aria-label={`Revoke the key ${one.name}`} onClick={onRevoke}>Revoke…</button></td>
    </tr>
  );
}
