/** All rollouts: those that are not over as cards, the others below them. */

import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rolloutsApi, type Rollout } from "../api/rollouts";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { Link, MayNot } from "../ui/parts";
import { go } from "../ui/url";
import { StartDialog } from "./start_dialog";
import { WaveLegend, WaveStrip } from "./wave_bars";
import { isOpen, robotsText, STATE_TONES, STATE_WORDS, thingOf } from "./words";

const EVERY_MS = 2000;
export const rolloutHref = (id: string) => `/rollouts/${encodeURIComponent(id)}`;

export function RolloutList() {
  const asked = useAsked(rolloutsApi.list, EVERY_MS);
  const starting = useSignal(false);
  const all = asked.value.value;
  return (
    <>
      <div class="rollouts-head">
        {all !== null && all.length > 0 ? <WaveLegend /> : <span />}
        {can("rollouts.manage") ? (
          <button type="button" class="button button-solid" onClick={() => (starting.value = true)}>Start a rollout…</button>
        ) : <MayNot what="start rollouts" least="Admins" />}
      </div>
      <Refusal text={asked.problem.value} />
      {all === null ? <p class="quiet">Asking the gateway…</p> : all.length === 0 ? <Nothing /> : (
        <ol class="rollouts">
          {all.filter(isOpen).map((one) => <RolloutCard key={one.id} one={one} />)}
          {all.filter((one) => !isOpen(one)).map((one) => <RolloutCard key={one.id} one={one} />)}
        </ol>
      )}
      {starting.value && <StartDialog onClose={() => (starting.value = false)} onStarted={({ id }) => go(rolloutHref(id))} />}
    </>
  );
}

function RolloutCard({ one }: { one: Rollout }) {
  const over = !isOpen(one);
  return (
    <li class="rollout" data-rollout={one.id} data-state={one.state} data-over={over}>
      <div class="rollout-head">
        <h3><Link class="rollout-link" href={rolloutHref(one.id)}>{thingOf(one)}</Link></h3>
        <Badge tone={STATE_TONES[one.state]}>{STATE_WORDS[one.state]}</Badge>
        <span class="rollout-facts">
          <code class="chip">{one.selector || "every robot"}</code>
          <span class="num">{robotsText(one.robots)}</span>
          {!over && <span class="num">wave {one.wave} of {one.waves.length}</span>}
          <span>{one.created_by}, {ageText(now.value - Date.parse(one.created))} ago</span>
        </span>
      </div>
      <WaveStrip rollout={one} />
      {one.reason && <p class={one.state === "halted" ? "rollout-why bad" : "rollout-why"}>{one.reason}</p>}
    </li>
  );
}

function Nothing() {
  return (
    <p class="nothing">
      No rollout yet. A rollout brings a version to many robots in waves: a few first, and more when those do well. When too many of a wave do
      badly it halts by itself. What can be brought stands under <Link class="text-link" href="/rollouts/versions">Versions</Link>.
    </p>
  );
}
