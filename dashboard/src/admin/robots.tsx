/** Robots' identities: enrol, what waits, who has which certificate, what looks wrong, and revoke. */

import { useSignal } from "@preact/signals";
import { adminApi, type EnrolmentToken, type RobotIdentity } from "../api/admin";
import { now } from "../live/age";
import { robots } from "../live/fleet";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";
import { agoText } from "./accounts";
import { ALARM_ADVICE, alarmed, certificateWords, countdown, currentCertificate, inOrder, tokenStanding } from "./certificates";
import { EnrolCard, type Made } from "./enrol";
import { Confirm, Refusal, type Question } from "./modal";
import { Badge, type Tone } from "./badge";
import { useAsked } from "./use_list";

const IDLE_MS = 5000;
const WAITING_MS = 1500;

const TONES: Record<string, Tone> = { good: "good", due: "warn", grace: "warn", over: "bad", revoked: "off" };

export function RobotsPart() {
  const made = useSignal<Made | null>(null);
  const name = useSignal("");
  const question = useSignal<Question | null>(null);
  const asked = useAsked(
    async () => {
      const [tokens, identities] = await Promise.all([adminApi.tokens(), adminApi.identities()]);
      return { tokens, identities };
    },
    made.value ? WAITING_MS : IDLE_MS,
  );
  const { tokens, identities } = asked.value.value ?? { tokens: null, identities: null };
  const revoke = (one: RobotIdentity) => (question.value = revokeQuestion(one, asked.refresh));
  const again = (robot: string) => {
    made.value = null;
    name.value = robot;
    scrollTo({ top: 0, behavior: "smooth" });
  };
  return (
    <>
      <Refusal text={asked.problem.value} />
      {identities && <Alarms identities={identities} onRevoke={revoke} />}
      <div class="admin-split">
        <EnrolCard made={made} name={name} tokens={tokens} onMade={() => { name.value = ""; void asked.refresh(); }} />
        <Tokens tokens={tokens} made={made.value} onDrop={(token) => (question.value = dropQuestion(token, asked.refresh))} />
      </div>
      <Identities identities={identities} onRevoke={revoke} onAgain={again} />
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </>
  );
}

const revokeQuestion = ({ robot }: RobotIdentity, done: () => Promise<void>): Question => ({
  title: `Revoke ${robot}?`,
  text: (
    <>
      <p>Its certificate stops counting now: the link to it is cut within seconds and nobody can drive or see it through this gateway.</p>
      <p>What it has recorded stays. To bring it back, enrol it again under the same name.</p>
    </>
  ),
  yes: "Revoke",
  reason: "Reason, for the log",
  run: async (reason) => {
    await adminApi.revokeRobot(robot, reason);
    await done();
  },
});

const dropQuestion = ({ id, robot }: EnrolmentToken, done: () => Promise<void>): Question => ({
  title: "Withdraw this command?",
  text: <p>The command made for {robot || "any robot"} will not enrol anything any more.</p>,
  yes: "Withdraw",
  run: async () => {
    await adminApi.dropToken(id);
    await done();
  },
});

function Alarms({ identities, onRevoke }: { identities: RobotIdentity[]; onRevoke: (one: RobotIdentity) => void }) {
  return (
    <>
      {alarmed(identities).map((one) => (
        <section key={one.robot} class="alarm" aria-label={`Alarm of ${one.robot}`} data-alarm={one.robot}>
          <svg viewBox="0 0 12 12" aria-hidden="true"><path d="M6 .8 11.600 11H.4ZM5.400 4.500h1.200l-.2 3.200h-.8Zm0 3.900h1.200v1.200H5.400Z" fill-rule="evenodd" /></svg>
          <div>
            <h2><span role="alert">{one.robot}: {one.alarm}</span> <small>{agoText(one.alarm_at, now.value)}</small></h2>
            <p>{ALARM_ADVICE}</p>
          </div>
          <button type="button" class="button button-danger" onClick={() => onRevoke(one)}>Revoke {one.robot}…</button>
        </section>
      ))}
    </>
  );
}

function Tokens({ tokens, made, onDrop }: { tokens: EnrolmentToken[] | null; made: Made | null; onDrop: (token: EnrolmentToken) => void }) {
  const open = tokens?.filter((token) => tokenStanding(token, now.value) === "open") ?? [];
  return (
    <section class="card" aria-labelledby="tokens-title" data-card="tokens">
      <header>
        <h2 id="tokens-title">Commands that wait for a robot</h2>
        {open.length > 0 && <span class="note num">{open.length}</span>}
      </header>
      {open.length === 0 ? (
        <p class="hint pad-in">{tokens === null ? "Asking the gateway…" : "None. A command that was used, withdrawn or has expired is not listed."}</p>
      ) : (
        <ul class="rows">
          {open.map((token) => (
            <li key={token.id} data-token={token.id}>
              <span>
                <b class="wrap">{token.robot || "any robot"}</b>{made?.token.id === token.id && <small> · just made</small>}
                <span class="sub">by {token.made_by === "local" ? "the gateway's machine" : token.made_by} · good for {countdown(Date.parse(token.expires) - now.value)}</span>
              </span>
              <button type="button" class="button" aria-label={`Withdraw the command for ${token.robot || "any robot"}`} onClick={() => onDrop(token)}>Withdraw…</button>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

interface IdentitiesProps {
  identities: RobotIdentity[] | null;
  onRevoke: (one: RobotIdentity) => void;
  onAgain: (robot: string) => void;
}

function Identities({ identities, onRevoke, onAgain }: IdentitiesProps) {
  const without = (robots.value ?? []).filter(({ id }) => !identities?.some(({ robot }) => robot === id));
  return (
    <>
      <div class="section-head"><h2>Robots with an identity</h2></div>
      {identities === null ? <p class="quiet">Asking the gateway…</p> : identities.length === 0 ? (
        <p class="nothing">
          No robot is enrolled yet. {without.length > 0 ? "" : "Make a command above and run it on the first one."}
        </p>
      ) : (
        <table class="admin-table identities">
          <thead>
            <tr>
              <th scope="col">Robot</th>
              <th scope="col">Certificate</th>
              <th scope="col">Enrolled</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {inOrder(identities, now.value).map((one) => (
              <IdentityRow key={one.robot} one={one} onRevoke={() => onRevoke(one)} onAgain={() => onAgain(one.robot)} />
            ))}
          </tbody>
        </table>
      )}
      {identities && without.length > 0 && (
        <p class="hint under">
          Without an identity, let in because they run on the gateway's own machine: <span class="wrap">{without.map(({ id }) => id).join(", ")}</span>.
        </p>
      )}
    </>
  );
}

function IdentityRow({ one, onRevoke, onAgain }: { one: RobotIdentity; onRevoke: () => void; onAgain: () => void }) {
  const known = robots.value?.find(({ id }) => id === one.robot);
  const words = certificateWords(one, now.value);
  const certificate = currentCertificate(one);
  return (
    <tr data-identity={one.robot} data-standing={words.status}>
      <td class="cell-name">
        {known ? <Link href={robotHref(one.robot)} class="name-link">{one.robot}</Link> : <b>{one.robot}</b>}
        <span class="sub">{known ? known.state : "never connected"}</span>
      </td>
      <td class="cell-wide" data-label="Certificate" title={certificate ? `serial ${certificate.serial}, until ${certificate.not_after}` : undefined}>
        <Badge tone={TONES[words.status]!}>{words.word}</Badge>
        <span class="sub">{words.note}</span>
        {one.alarm && one.state === "active" && <span class="sub bad">▲ {one.alarm}</span>}
      </td>
      <td class="num" data-label="Enrolled" title={one.enrolled}>{agoText(one.enrolled, now.value)}</td>
      <td class="end cell-actions">
        <button type="button" class="button" aria-label={`Enrol ${one.robot} again`} onClick={onAgain}>Enrol again</button>
        {one.state === "active" && <button type="button" class="button" aria-label={`Revoke ${one.robot}`} onClick={onRevoke}>Revoke…</button>}
      </td>
    </tr>
  );
}
