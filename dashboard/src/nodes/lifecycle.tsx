/** A managed node's lifecycle: where it stands, and the steps that lead on from there. */

import { useSignal } from "@preact/signals";
import { Confirm, Refusal, useAttempt, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { nodesApi, type Lifecycle, type Node, type Transition } from "../api/nodes";
import { can } from "../api/session";

const LOOK_MS = 3000;
/** The way of a node; "finalized" is its end, from wherever it comes. */
const STATES = ["unconfigured", "inactive", "active", "finalized"] as const;

export function LifecycleView({ node: { robot, name } }: { node: Node }) {
  const asked = useAsked<Lifecycle>(() => nodesApi.lifecycle(robot, name), LOOK_MS);
  const keep = useSignal(false);
  const question = useSignal<Question | null>(null);
  const said = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  const found = asked.value.value;
  if (!found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="hint pad-in">Asking the node…</p>;
  if (!found.managed) return <p class="hint pad-in">This node has no lifecycle: it is not a managed node, it simply runs.</p>;
  const run = async (transition: Transition) => {
    said.value = "";
    const result = await nodesApi.transit(robot, name, transition, keep.value && transition !== "cleanup");
    said.value = result.success ? `${transition}: it is ${result.state} now.` : `${transition} did not succeed: it is ${result.state}.`;
    await asked.refresh();
  };
  const go = (transition: Transition) => {
    if (transition === "shutdown") question.value = { title: `Shut ${name} down?`, text: <p>A node that is finalized does not come back without a restart.</p>, yes: "Shut it down", run: () => run(transition) };
    else void attempt(() => run(transition));
  };
  const known = STATES.some((state) => state === found.state);
  return (
    <div class="lifecycle" data-lifecycle={found.state}>
      <ol class="states" aria-label="States">
        {STATES.map((state) => (
          <li key={state} aria-current={state === found.state ? "step" : undefined} data-wanted={state === found.wanted}>
            {state}{state === found.wanted && state !== found.state && <small> desired</small>}
          </li>
        ))}
      </ol>
      {!known && <p>It is <b>{found.state}</b>.</p>}
      {found.wanted && found.wanted !== found.state && <p class="sub sub-why">The twin wants it {found.wanted}.</p>}
      {can("nodes.control") && (
        <>
          <div class="lifecycle-acts">
            {found.transitions.map((transition) => (
              <button key={transition} type="button" class={transition === "shutdown" ? "button" : "button button-solid"} disabled={busy.value} onClick={() => go(transition)}>{transition[0]!.toUpperCase() + transition.slice(1)}{transition === "shutdown" && "…"}</button>
            ))}
          </div>
          <label class="check"><input type="checkbox" checked={keep.value} onChange={(event) => (keep.value = event.currentTarget.checked)} /> Keep: the twin brings it there again after each start</label>
        </>
      )}
      <p role="status">{said.value}</p>
      <Refusal text={problem.value || asked.problem.value} />
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </div>
  );
}
