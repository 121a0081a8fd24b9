/** One node of the table: its state by colour, shape and word, why it is so, and the buttons that make sense now. */

import { Badge } from "../admin/badge";
import type { Node, NodeVerb } from "../api/nodes";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { integer, NONE } from "../ui/format";
import { programOf, reasonsOf, toneOf, VERB_WORDS, verbsOf } from "./node_words";

interface NodeRowProps {
  node: Node;
  chosen: boolean;
  busy: boolean;
  onAct: (verb: NodeVerb) => void;
  onChoose: () => void;
}

export function NodeTableRow({ node, chosen, busy, onAct, onChoose }: NodeRowProps) {
  const { reported, desired, online } = node;
  const runs = online && reported?.pid ? reported : null;
  const sinceMs = runs?.since ? now.value - Date.parse(runs.since) : null;
  const version = reported?.version || (desired?.bundle ? NONE : "");
  return (
    <tr data-node={node.name} data-state={node.state} data-step={node.in_step} class={online ? undefined : "row-stale"} aria-selected={chosen}>
      <td class="cell-name">
        <button type="button" class="node-name" aria-expanded={chosen} onClick={onChoose}>{node.name}</button>
        {desired?.critical && <span class="chip chip-critical">critical</span>}
        {desired?.migratable && <span class="chip">migratable</span>}
        <span class="sub" title={programOf(node)}>{programOf(node)}</span>
      </td>
      <td class="cell-wide cell-node-state" data-label="State">
        <Badge tone={toneOf(node)}>{node.state}</Badge>
        {!online && <small> last known</small>}
        {reasonsOf(node).map((reason) => <span key={reason} class={node.in_step ? "sub" : "sub sub-why"}>{reason}</span>)}
      </td>
      <td class="end num" data-label="PID">{runs ? runs.pid : NONE}</td>
      <td class="end num" data-label="Up" title={runs?.since ?? undefined}>{sinceMs === null ? NONE : ageText(sinceMs)}</td>
      <td class={reported && reported.restarts > 0 ? "end num worry" : "end num"} data-label="Restarts">{reported ? integer(reported.restarts) : NONE}</td>
      <td class="num" data-label="Version">
        {version || NONE}
        {desired?.version && reported?.version && desired.version !== reported.version && <span class="sub sub-why">{desired.version} is desired</span>}
      </td>
      <td class="wrap" data-label="Lease"><Lease node={node} /></td>
      <td class="end cell-actions">
        {can("nodes.control") && verbsOf(node).map((verb) => (
          <button key={verb} type="button" class="button" disabled={busy} aria-label={`${VERB_WORDS[verb]} ${node.name}`} onClick={() => onAct(verb)}>{VERB_WORDS[verb]}</button>
        ))}
      </td>
    </tr>
  );
}

/** Of a migratable node: who may run it now. */
function Lease({ node: { desired, reported, holder, robot } }: { node: Node }) {
  if (!desired?.migratable) return <span class="none">{NONE}</span>;
  if (holder === robot || (!holder && reported?.lease_id)) return <>here</>;
  return holder ? <>on {holder}</> : <span class="none">nobody</span>;
}
