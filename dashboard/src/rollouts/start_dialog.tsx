/** Starting a rollout: what, which robots, in which waves; a dry run first, and only what it showed can be started. */

import { useSignal, type Signal } from "@preact/signals";
import { useEffect, useId, useRef } from "preact/hooks";
import { SegmentedControl } from "../admin/segmented_control";
import { TextField } from "../admin/fields";
import { Modal, Refusal, useAttempt } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rolloutsApi, type Bundle, type RolloutDetail } from "../api/rollouts";
import { templatesApi } from "../api/templates";
import { Link } from "../ui/parts";
import { FIRST, orderOf, type Plan } from "./plan";
import { SelectorField } from "./selector_field";
import { WaveRows } from "./wave_bars";
import { CARE, isReady, newestFirst, nodesOf, robotsText, thingOf } from "./words";

const NEVER_MS = 3_600_000;

export function StartDialog({ onClose, onStarted }: { onClose: () => void; onStarted: (made: RolloutDetail) => void }) {
  const updates = useAsked(rolloutsApi.updates, NEVER_MS);
  const bundles = newestFirst((updates.value.value?.bundles ?? []).filter(isReady));
  const plan = useSignal<Plan>(FIRST);
  const shown = useSignal<{ order: string; made: RolloutDetail } | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const bundle = bundles.find(({ path }) => path === plan.value.path) ?? bundles[0];
  const order = bundle && orderOf(plan.value, bundle);
  const text = JSON.stringify(order);
  const dry = shown.value !== null && shown.value.order === text ? shown.value.made : null; // another plan needs another dry run
  const submit = async (close: () => void) => {
    if (!order) return;
    if (!dry) {
      shown.value = { order: text, made: await rolloutsApi.start(order, true) };
      return;
    }
    const made = await rolloutsApi.start(order, false);
    close();
    onStarted(made);
  };
  return (
    <Modal title="Start a rollout" onClose={onClose}>
      {(close) => updates.value.value && !bundle ? <NoVersion close={close} /> : (
        <form
          class="rollout-form"
          onSubmit={(event) => {
            event.preventDefault();
            void attempt(() => submit(close));
          }}
        >
          <WhatFields plan={plan} bundles={bundles} bundle={bundle} />
          <SelectorField value={plan.value.selector} onInput={(selector) => (plan.value = { ...plan.value, selector })} />
          <HowFields plan={plan} />
          {dry && <DryRun made={dry} />}
          <div class="dialog-foot">
            <Refusal text={problem.value || updates.problem.value} />
            <div class="dialog-end">
              <span />
              <button type="button" class="button" onClick={close}>Cancel</button>
              <button class="button button-solid" disabled={busy.value || !bundle}>{dry ? `Start for ${robotsText(dry.robots)}` : "Dry run"}</button>
            </div>
          </div>
        </form>
      )}
    </Modal>
  );
}

interface PlanProps {
  plan: Signal<Plan>;
}

function WhatFields({ plan, bundles, bundle }: PlanProps & { bundles: Bundle[]; bundle: Bundle | undefined }) {
  const id = useId();
  const set = (change: Partial<Plan>) => (plan.value = { ...plan.value, ...change });
  return (
    <>
      <div class="field">
        <span><label for={id}>Version</label></span>
        <select id={id} value={bundle?.path} onChange={(event) => set({ path: event.currentTarget.value, node: "" })}>
          {bundles.map(({ path, kind, name, version }) => <option key={path} value={path}>{kind === "agent" ? `agent ${version}` : `${name} ${version}`}</option>)}
        </select>
      </div>
      {bundle?.kind === "node" && <NodeField key={bundle.name} bundle={bundle.name} value={plan.value.node} onInput={(node) => set({ node })} />}
    </>
  );
}

function NodeField({ bundle, value, onInput }: { bundle: string; value: string; onInput: (node: string) => void }) {
  const templates = useAsked(templatesApi.list, NEVER_MS);
  const known = nodesOf(templates.value.value ?? [], bundle);
  const hint = known.length > 0 ? `Templates run it as ${known.join(", ")}. Empty: as the bundle.` : "The node's name in the robots' twins. Empty: as the bundle.";
  return <TextField label="Node" mono placeholder={bundle} hint={hint} options={known} value={value} onInput={onInput} />;
}

function HowFields({ plan }: PlanProps) {
  const set = (change: Partial<Plan>) => (plan.value = { ...plan.value, ...change });
  const { waves, failures, healthS, steadyS, offlineS } = plan.value;
  return (
    <>
      <SegmentedControl label="How" choices={CARE.map(([word, text]) => [text, word])} chosen={waves} onChoose={(text) => set({ waves: text })} />
      <TextField label="Waves" mono hint="Numbers of robots, or percentages of all. What they leave is a last wave." value={waves} onInput={(text) => set({ waves: text })} />
      <details class="limits">
        <summary>When a robot counts as failed</summary>
        <div class="limit-fields">
          <TextField label="Halt at more than" note="% of a wave" value={failures} onInput={(text) => set({ failures: text })} />
          <TextField label="Healthy within" note="s" value={healthS} onInput={(text) => set({ healthS: text })} />
          <TextField label="…and for" note="s without a break" value={steadyS} onInput={(text) => set({ steadyS: text })} />
          <TextField label="Offline at most" note="s while at it" value={offlineS} onInput={(text) => set({ offlineS: text })} />
        </div>
      </details>
    </>
  );
}

/** What would happen. Who goes first is drawn anew for each rollout, so nobody is named. */
function DryRun({ made }: { made: RolloutDetail }) {
  const section = useRef<HTMLElement>(null);
  useEffect(() => section.current?.scrollIntoView({ block: "nearest" }), [made]);
  return (
    <section ref={section} class="dry-run" aria-label="Dry run" role="status">
      <h3>{thingOf(made)} to {robotsText(made.robots)} in {made.waves.length} {made.waves.length === 1 ? "wave" : "waves"}</h3>
      <WaveRows rollout={{ ...made, wave: 0 }} />
      <p class="hint">Nothing has begun. Each wave waits for the one before it to do well.</p>
    </section>
  );
}

function NoVersion({ close }: { close: () => void }) {
  return (
    <>
      <p class="prose">No version is signed that robots may have. <Link class="text-link" href="/rollouts/versions">Versions</Link> says what is uploaded.</p>
      <div class="dialog-end"><span /><button type="button" class="button" onClick={close}>Close</button></div>
    </>
  );
}
