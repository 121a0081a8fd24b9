/** One rollout: how far it is, why it stands still, what can be done, and each of its robots. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Badge } from "../admin/badge";
import { Confirm, Refusal, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rolloutsApi, type Rollout, type RolloutDetail } from "../api/rollouts";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { duration } from "../ui/format";
import { Link, MayNot } from "../ui/parts";
import { RolloutRobotTable } from "./rollout_robots";
import { ResumeDialog } from "./resume_dialog";
import { WaveLegend, WaveRows } from "./wave_bars";
import { isOpen, robotsText, settled, STATE_TONES, STATE_WORDS, thingOf } from "./words";

const EVERY_MS = 1500;
const MANY = 1000;
const MANY_MS = 5000; // each answer holds every robot
const OVER_MS = 30_000;

export function RolloutPage({ id }: { id: string }) {
  const everyMs = useSignal(EVERY_MS);
  const asked = useAsked(() => rolloutsApi.get(id), everyMs.value);
  const one = asked.value.value;
  useEffect(() => {
    if (one) everyMs.value = !isOpen(one) ? OVER_MS : one.robots > MANY ? MANY_MS : EVERY_MS;
  }, [one]);
  if (!one) {
    return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Asking the gateway…</p>;
  }
  return (
    <>
      <header class="robot-head rollout-title">
        <p class="crumb"><Link href="/rollouts">Rollouts</Link> /</p>
        <h1>{thingOf(one)}</h1>
        <span data-rollout-state={one.state}><Badge tone={STATE_TONES[one.state]}>{STATE_WORDS[one.state]}</Badge></span>
        <Actions one={one} refresh={asked.refresh} />
      </header>
      <Refusal text={asked.problem.value} />
      <Why one={one} />
      <section class="card card-waves" aria-label="Waves">
        <header>
          <h2>Waves</h2>
          <span class="note num">{Math.round(settled(one) * 100)} % of {robotsText(one.robots)} settled</span>
        </header>
        <WaveRows rollout={one} />
        <WaveLegend />
      </section>
      <Facts one={one} />
      <RolloutRobotTable members={one.members} counts={one.counts} />
    </>
  );
}

/** Why it does not go on, with what helps. */
function Why({ one }: { one: Rollout }) {
  if (one.state === "halted") {
    return (
      <section class="alarm" role="alert" data-halted>
        <svg viewBox="0 0 12 12" aria-hidden="true"><path d="M6 .5 12 11.500H0Z" /></svg>
        <div>
          <h2>It halted by itself</h2>
          <p class="wrap">{one.reason}</p>
          <p>Robots that were at it go on; no other robot gets the version. Mend it and resume with the mended version, or go on all the same, or end it.</p>
        </div>
      </section>
    );
  }
  if (!one.reason) return null;
  return <p class="rollout-note wrap"><b>{one.state === "paused" ? "Paused" : "Ended"}</b>: {one.reason}</p>;
}

function Actions({ one, refresh }: { one: RolloutDetail; refresh: () => Promise<void> }) {
  const question = useSignal<Question | null>(null);
  const resuming = useSignal(false);
  if (!isOpen(one)) return null;
  if (!can("rollouts.manage")) return <MayNot what="steer rollouts" least="Admins" />;
  return (
    <span class="rollout-actions">
      {one.state === "running" ? (
        <button type="button" class="button" onClick={() => (question.value = pauseQuestion(one, refresh))}>Pause…</button>
      ) : (
        <button type="button" class="button button-solid" onClick={() => (resuming.value = true)}>Resume…</button>
      )}
      <button type="button" class="button button-danger" onClick={() => (question.value = abortQuestion(one, refresh))}>End it…</button>
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
      {resuming.value && <ResumeDialog one={one} onClose={() => (resuming.value = false)} onDone={refresh} />}
    </span>
  );
}

const pauseQuestion = (one: Rollout, done: () => Promise<void>): Question => ({
  title: `Pause ${thingOf(one)}?`,
  text: <p>No other robot gets the version until somebody resumes it. The {robotsText(one.counts.starting + one.counts.updating)} at it go on.</p>,
  yes: "Pause",
  reason: "Why",
  run: async (reason) => {
    await rolloutsApi.pause(one.id, reason);
    await done();
  },
});

const abortQuestion = (one: Rollout, done: () => Promise<void>): Question => ({
  title: `End ${thingOf(one)} for good?`,
  text: (
    <p>
      {robotsText(one.counts.waiting)} that wait are left out. Robots that got the version keep what their twins say: nothing is taken back. It cannot be
      resumed.
    </p>
  ),
  yes: "End it",
  reason: "Why",
  run: async (reason) => {
    await rolloutsApi.abort(one.id, reason);
    await done();
  },
});

function Facts({ one }: { one: Rollout }) {
  const at = now.value;
  const facts: [string, string][] = [
    ["Robots", one.selector || "every robot"],
    ["Brings", one.kind === "agent" ? `the agent ${one.version}` : `${one.bundle} ${one.version} as node ${one.node}`],
    ["Begun", `${ageText(at - Date.parse(one.created))} ago by ${one.created_by}`],
    ["Changed", `${ageText(at - Date.parse(one.changed))} ago`],
    ["Halts", `when more than ${Math.round(one.max_failure_rate * 100)} % of a wave fail`],
    ["Healthy", `within ${duration(one.health_s)}, for ${duration(one.steady_s)}`],
    ["Offline", `for at most ${duration(one.offline_s)} while at it`],
    ["Gives up", `after ${duration(one.give_up_s)} on who never comes`],
  ];
  return (
    <dl class="rollout-plan">
      {facts.map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="wrap">{value}</dd></div>)}
    </dl>
  );
}
