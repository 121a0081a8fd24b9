/** Enrolling a robot: a command to take to it, and whether the robot has used it. */

import { useSignal, type Signal } from "@preact/signals";
import { adminApi, type EnrolmentToken, type NewEnrolmentToken } from "../api/admin";
import { now } from "../live/age";
import { robots } from "../live/fleet";
import { Link } from "../ui/parts";
import { robotHref } from "../ui/url";
import { commandFor, countdown } from "./certificates";
import { CopyField } from "./copy";
import { TextField } from "./fields";
import { Refusal, useAttempt } from "./modal";

const LIVES: readonly [string, number][] = [["15 min", 900], ["1 hour", 3600], ["1 day", 86_400]];

/** A token that was made on this page; its end by this browser's clock, whatever the gateway's says. */
export interface Made {
  token: NewEnrolmentToken;
  endsMs: number;
}

interface EnrolProps {
  made: Signal<Made | null>;
  /** The robot that the form is for; somebody pressed "Enrol again" there. */
  name: Signal<string>;
  tokens: EnrolmentToken[] | null;
  onMade: () => void;
}

export function EnrolCard({ made, name, tokens, onMade }: EnrolProps) {
  const current = made.value;
  const used = current && tokens?.find(({ id }) => id === current.token.id)?.used_by;
  return (
    <section class="card card-enrol" aria-labelledby="enrol-title" data-card="enrol">
      <header>
        <h2 id="enrol-title">Enrol a robot</h2>
        {current && !used && <Left endsMs={current.endsMs} />}
      </header>
      {current === null ? <EnrolForm made={made} name={name} onMade={onMade} /> : used ? <Enrolled robot={used} onNext={() => (made.value = null)} /> : <Command made={current} onNext={() => (made.value = null)} />}
    </section>
  );
}

function Left({ endsMs }: { endsMs: number }) {
  const left = endsMs - now.value;
  return <span class="note num" role="timer">{left > 0 ? `good for ${countdown(left)}` : "expired"}</span>;
}

function EnrolForm({ made, name, onMade }: Omit<EnrolProps, "tokens">) {
  const lifeS = useSignal(3600);
  const { busy, problem, attempt } = useAttempt();
  const make = async () => {
    const token = await adminApi.makeToken(name.value.trim(), lifeS.value);
    made.value = { token, endsMs: Date.now() + Date.parse(token.expires) - Date.parse(token.made) };
    onMade();
  };
  return (
    <form
      class="pad-in"
      onSubmit={(event) => {
        event.preventDefault();
        void attempt(make);
      }}
    >
      <p class="hint">
        This makes one command. Run on the robot, it gives the robot a key of its own, which never leaves it, and a certificate of this fleet.
      </p>
      <div class="fields">
        <TextField label="Name of the robot" note="optional" placeholder="arm_1" mono most={64} focus={name.value !== ""} value={name.value} onInput={(text) => (name.value = text)} />
        <div class="field" role="group" aria-label="The command is good for">
          <span>Good for</span>
          <div class="segments">
            {LIVES.map(([word, seconds]) => (
              <button key={word} type="button" aria-pressed={lifeS.value === seconds} onClick={() => (lifeS.value = seconds)}>{word}</button>
            ))}
          </div>
        </div>
        <button class="button button-solid" disabled={busy.value}>Make the command</button>
      </div>
      <p class="hint">Without a name the robot takes its own, if nobody has it. A name that was enrolled before is replaced: the old key stops working.</p>
      <Refusal text={problem.value} />
    </form>
  );
}

/** The command, for as long as it waits for its robot. */
function Command({ made: { token, endsMs }, onNext }: { made: Made; onNext: () => void }) {
  const over = now.value >= endsMs;
  return (
    <div class="pad-in enrol-steps">
      {over ? (
        <p class="refusal">Nobody used the command in its time. Make another one.</p>
      ) : (
        <>
          <p>Run this on {token.robot ? <b class="wrap">{token.robot}</b> : "the robot"}, as the user that will run its agent:</p>
          <CopyField text={commandFor(token.command, location.origin)} label="The command that enrols the robot" name="enrol" />
          <p class="hint">
            <b class="once">Shown this once.</b> It works for one robot, one time. Whoever runs it first is {token.robot || "in the fleet"}, so hand it on like a password.
          </p>
        </>
      )}
      <p class="enrol-end">
        {!over && <span class="waiting" role="status"><i aria-hidden="true" /> Waiting for the robot…</span>}
        <button type="button" class="button" onClick={onNext}>{over ? "Make another" : "Enrol another robot"}</button>
      </p>
    </div>
  );
}

function Enrolled({ robot, onNext }: { robot: string; onNext: () => void }) {
  const online = robots.value?.find(({ id }) => id === robot)?.state === "online";
  return (
    <div class="pad-in enrol-steps">
      <p class="enrol-done" role="status">
        <svg viewBox="0 0 12 12" aria-hidden="true"><path d="m1.500 6.300 3 3 6-6.600" /></svg>
        <b class="wrap">{robot} is enrolled</b>
      </p>
      {online ? (
        <p><Link href={robotHref(robot)} class="text-link">It is online: look at it</Link></p>
      ) : (
        <>
          <p>Now start its agent there. It knows the gateway and shows its certificate by itself.</p>
          <CopyField text={`metaros agent --name ${robot}`} label="The command that starts the agent" name="agent" />
        </>
      )}
      <p class="enrol-end"><button type="button" class="button" onClick={onNext}>Enrol another robot</button></p>
    </div>
  );
}
