/** How a node ended the last times: when, why, after how long, and its last words. */

import { agoText } from "../admin/accounts";
import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { nodesApi, type Crash, type Node } from "../api/nodes";
import { now } from "../live/age";
import { duration } from "../ui/format";

const LOOK_MS = 10_000;

export function CrashesView({ node: { robot, name } }: { node: Node }) {
  const asked = useAsked(() => nodesApi.crashes(robot, name), LOOK_MS);
  const found = asked.value.value;
  if (!found) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="hint pad-in">Asking the robot…</p>;
  return (
    <>
      <Refusal text={asked.problem.value} />
      {found.length === 0 ? <p class="hint pad-in">It has not crashed, as far as the robot remembers.</p> : (
        <ol class="crashes">
          {found.map((crash, i) => <CrashRow key={`${crash.at} ${crash.pid}`} crash={crash} open={i === 0} />)}
        </ol>
      )}
    </>
  );
}

function CrashRow({ crash, open }: { crash: Crash; open: boolean }) {
  const env = Object.entries(crash.env);
  return (
    <li data-crash={crash.pid}>
      <details open={open}>
        <summary>
          <Badge tone="bad">{crash.reason || "ended"}</Badge>
          <span class="crash-when" title={crash.at ?? undefined}>{agoText(crash.at, now.value, "at an unknown time")}</span>
          <small class="num">
            {[crash.ran_s !== null && `ran ${duration(crash.ran_s)}`, crash.pid !== null && `pid ${crash.pid}`, crash.version].filter(Boolean).join(" · ")}
          </small>
        </summary>
        <h3>Last words</h3>
        <pre class="last-words" tabIndex={0}>{crash.lines.length > 0 ? crash.lines.join("\n") : "none"}</pre>
        {crash.argv.length > 0 && <p class="mono wrap crash-argv"><span class="hint">ran</span> {crash.argv.join(" ")}</p>}
        {env.length > 0 && (
          <details class="crash-env">
            <summary>Environment <small class="num">{env.length}</small></summary>
            <dl>{env.map(([key, value]) => <div key={key}><dt class="mono">{key}</dt><dd class="mono wrap">{value}</dd></div>)}</dl>
          </details>
        )}
      </details>
    </li>
  );
}
