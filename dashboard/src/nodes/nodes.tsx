/** The Nodes tab: every node of the robot as it is and as it is to be, what can be done with it, and one looked at closely. */

import { useSignal } from "@preact/signals";
import { Confirm, Refusal, useAttempt, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { nodesApi, type Node, type NodeVerb } from "../api/nodes";
import { can } from "../api/session";
import type { Robot } from "../api/types";
import { Link, MayNot } from "../ui/parts";
import { place, robotHref, setParam } from "../ui/url";
import { NodePanel } from "./node_panel";
import { NodeTableRow } from "./node_row";
import { resultWords } from "./node_words";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/nodes.css";

const LOOK_MS = 2000;

export function NodesTab({ robot }: { robot: Robot }) {
  const asked = useAsked(() => nodesApi.list(robot.id), LOOK_MS);
  const said = useSignal("");
  const question = useSignal<Question | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const found = asked.value.value;
  if (!found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Reading the robot's nodes…</p>;
  const chosen = found.nodes.find(({ name }) => name === place.value.params.get("node"));
  const run = async (node: Node, verb: NodeVerb, signal?: number) => {
    said.value = "";
    const result = await nodesApi.act(robot.id, node.name, verb, signal);
    said.value = resultWords(result);
    await asked.refresh();
  };
  const act = (node: Node, verb: NodeVerb, signal?: number) => {
    if (verb === "stop" && node.desired?.critical) question.value = stopQuestion(node, () => run(node, verb));
    else void attempt(() => run(node, verb, signal));
  };
  const down = found.nodes.filter(({ in_step }) => !in_step).length;
  return (
    <div class="ops">
      <div class="nodes-head">
        <p class="counts">
          <span><b>{found.nodes.length}</b> {found.nodes.length === 1 ? "node" : "nodes"}</span>
          <span><b>{found.nodes.filter(({ state, online }) => online && state === "running").length}</b> running</span>
          {down > 0 && <span class="count-attention"><b>{down}</b> not as desired</span>}
        </p>
        {!found.online && <p class="hint">The robot is offline: this is what it said last. Start and stop reach it when it is back.</p>}
        {found.online && !found.in_step && <p class="hint">The robot is not at what is desired of it: <Link href={`${robotHref(robot.id)}?tab=config`} class="text-link">see Config</Link></p>}
        <p class="nodes-said" role="status">{said.value}</p>
      </div>
      <Refusal text={problem.value || asked.problem.value} />
      {!can("nodes.control") && <MayNot what="start and stop nodes" />}
      {found.nodes.length === 0 ? (
        <p class="nothing">This robot runs no nodes for the fleet. Nodes are named in what is desired of it: <Link href={`${robotHref(robot.id)}?tab=config`} class="text-link">Config</Link></p>
      ) : (
        <div class="scroll">
          <table class="nodes-table">
            <thead>
              <tr>
                <th scope="col">Node</th>
                <th scope="col">State</th>
                <th scope="col" class="end">PID</th>
                <th scope="col" class="end">Up</th>
                <th scope="col" class="end">Restarts</th>
                <th scope="col">Version</th>
                <th scope="col">Lease</th>
                <th scope="col"><span class="visually-hidden">Actions</span></th>
              </tr>
            </thead>
            <tbody>
              {found.nodes.map((node) => (
                <NodeTableRow key={node.name} node={node} chosen={node === chosen} busy={busy.value} onAct={(verb) => act(node, verb)} onChoose={() => setParam("node", node === chosen ? "" : node.name)} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {chosen && <NodePanel key={chosen.name} node={chosen} onSignal={(signal) => act(chosen, "signal", signal)} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </div>
  );
}

const stopQuestion = ({ name }: Node, run: () => Promise<void>): Question => ({
  title: `Stop ${name}?`,
  text: <p>It is marked critical: the robot may not do without it. It stays stopped until somebody starts it.</p>,
  yes: "Stop it",
  run,
});
