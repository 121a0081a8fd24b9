/** The actions that the robot's nodes serve, each with the form that begins a goal. */

import type { RobotGraph } from "../api/introspect";
import type { Robot } from "../api/types";
import { relativeTopic, typeWord } from "../ui/format";
import { place, setParam } from "../ui/url";
import { lazy } from "../views/lazy";

const GoalForm = lazy(async () => (await import("./goal_form")).GoalForm);

export function Actions({ robot, graph, wanted }: { robot: Robot; graph: RobotGraph | null; wanted: string }) {
  const served = (graph?.actions ?? []).filter(({ servers }) => servers.length > 0);
  const shown = served.filter(({ action }) => action.toLowerCase().includes(wanted));
  const chosen = place.value.params.get("action");
  if (served.length === 0) return null;
  return (
    <section class="services" aria-labelledby="actions-title">
      <header class="section-head"><h2 id="actions-title">Actions <small>{shown.length}</small></h2></header>
      <ul class="service-list">
        {shown.map(({ action, type, servers }) => {
          const open = action === chosen;
          return (
            <li key={action} data-action={action}>
              <div class="service-head">
                <button type="button" class="node-name mono" aria-expanded={open} onClick={() => setParam("action", open ? "" : action)}>{relativeTopic(action, robot.namespace)}</button>
                <span class="sub" title={type}>{typeWord(type)}</span>
                <span class="sub service-of">{servers.map((node) => relativeTopic(node, robot.namespace)).join(", ")}</span>
              </div>
              {open && <GoalForm robot={robot} action={action} type={type} />}
            </li>
          );
        })}
      </ul>
    </section>
  );
}
