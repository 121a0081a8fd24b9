/** Where functions run: how well they are shut in here and why not better, and the workers of each version. */

import { Badge } from "../admin/badge";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { functionsApi, type Runtime } from "../api/functions";
import { bytes, integer } from "../ui/format";
import { Link } from "../ui/parts";
import { LEVEL_WORDS, LEVELS } from "./levels";
import { functionHref } from "./words";

const EVERY_MS = 3000;

export function RuntimePart() {
  const asked = useAsked(functionsApi.runtime, EVERY_MS);
  const runtime = asked.value.value;
  if (!runtime) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Asking the gateway…</p>;
  return (
    <div class="fn-runtime">
      <Refusal text={runtime.trouble || asked.problem.value} />
      <LevelsCard runtime={runtime} />
      <FactsCard runtime={runtime} />
      <PoolsCard runtime={runtime} />
    </div>
  );
}

function LevelsCard({ runtime: { level, reasons, require, started } }: { runtime: Runtime }) {
  return (
    <section class="card" aria-label="Sandbox">
      <header><h2>Sandbox</h2><span class="note">{started ? `started with --sandbox-require ${require}` : "is found out at the first call"}</span></header>
      <ol class="levels">
        {LEVELS.map((name) => {
          const [short, tone, means] = LEVEL_WORDS[name]!;
          const works = reasons[name] === "ok";
          const here = name === level;
          return (
            <li key={name} data-level={name} data-here={here}>
              <b>{name}</b>
              <div>
                <h3>{short} {here && <Badge tone={tone}>functions run so</Badge>}</h3>
                <p>{means}</p>
                {!works && reasons[name] && <p class="level-why">Not here: {reasons[name]}</p>}
              </div>
            </li>
          );
        })}
      </ol>
    </section>
  );
}

function FactsCard({ runtime }: { runtime: Runtime }) {
  return (
    <section class="card" aria-label="Workers">
      <header><h2>Workers</h2></header>
      <p class="big pad-in">{runtime.workers} <span class="uplink-state">of at most {runtime.most_workers}</span></p>
      <dl class="alert-dl">
        <div><dt>Memory now</dt><dd class="num">{bytes(runtime.memory_mb * 1e6)}</dd></div>
        <div><dt>Interpreter</dt><dd>{runtime.interpreter}</dd></div>
        <div><dt>Runtimes</dt><dd>{runtime.runtimes.join(", ")} <small>each runs on this interpreter</small></dd></div>
        {runtime.entry && <div><dt>Client</dt><dd>{runtime.entry}</dd></div>}
        {!runtime.on && <div><dt>State</dt><dd>off: started with <code>--no-functions</code></dd></div>}
      </dl>
    </section>
  );
}

function PoolsCard({ runtime: { pools } }: { runtime: Runtime }) {
  return (
    <section class="card fn-pools" aria-label="Pools">
      <header><h2>Pools</h2><span class="note">one for each version that is called</span></header>
      {pools.length === 0 ? <p class="hint pad-in">No worker lives: the first call starts one, and it stays warm for a while.</p> : (
        <table class="admin-table">
          <thead>
            <tr>
              <th scope="col">Function</th>
              <th scope="col" class="end">Workers</th>
              <th scope="col" class="end">Waiting</th>
              <th scope="col" class="end">Calls</th>
              <th scope="col" class="end">Cold starts</th>
              <th scope="col" class="end">Memory</th>
              <th scope="col">Client</th>
            </tr>
          </thead>
          <tbody>
            {pools.map((pool) => (
              <tr key={`${pool.function}:${pool.version}`} data-pool={pool.function}>
                <td class="cell-name"><Link href={functionHref(pool.function)} class="text-link">{pool.function}</Link> <span class="chip">{pool.version}</span>{pool.init_error && <span class="sub bad">{pool.init_error}</span>}</td>
                <td class="num end" data-label="Workers">{pool.workers}<span class="sub">{pool.busy} busy{pool.starting > 0 && `, ${pool.starting} starting`}</span></td>
                <td class="num end" data-label="Waiting">{integer(pool.waiting)}</td>
                <td class="num end" data-label="Calls">{integer(pool.calls)}{pool.failures > 0 && <span class="sub bad">{integer(pool.failures)} failed</span>}</td>
                <td class="num end" data-label="Cold starts">{integer(pool.cold_starts)}</td>
                <td class="num end" data-label="Memory">{bytes(pool.memory_mb * 1e6)}</td>
                <td data-label="Client">{pool.entry}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}
