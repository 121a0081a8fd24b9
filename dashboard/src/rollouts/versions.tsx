/** Versions that robots may be given, and how long the signatures over them count. */

import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Confirm, Refusal, type Question } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { rolloutsApi, type Bundle, type SignedRole } from "../api/rollouts";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { bytes, duration } from "../ui/format";
import { newestFirst } from "./words";

const EVERY_MS = 10_000;
const SOON_S = 7 * 86_400;

export function VersionsPart() {
  const asked = useAsked(rolloutsApi.updates, EVERY_MS);
  const question = useSignal<Question | null>(null);
  const updates = asked.value.value;
  return (
    <>
      <Refusal text={asked.problem.value} />
      {updates?.trouble && <Refusal text={updates.trouble} />}
      {updates === null ? <p class="quiet">Asking the gateway…</p> : updates.bundles.length === 0 ? <Nothing /> : (
        <table class="admin-table bundles">
          <thead>
            <tr>
              <th scope="col">Bundle</th>
              <th scope="col">Version</th>
              <th scope="col">State</th>
              <th scope="col" class="end">Size</th>
              <th scope="col">Uploaded</th>
              <th scope="col"><span class="visually-hidden">Actions</span></th>
            </tr>
          </thead>
          <tbody>
            {newestFirst(updates.bundles).map((one) => (
              <BundleRow key={one.path} one={one} onWithdraw={() => (question.value = withdrawQuestion(one, asked.refresh))} />
            ))}
          </tbody>
        </table>
      )}
      {updates && updates.roles.length > 0 && <Roles roles={updates.roles} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </>
  );
}

function BundleRow({ one, onWithdraw }: { one: Bundle; onWithdraw: () => void }) {
  const needs = [one.python && `Python ${one.python}`, one.hw.join(", "), one.min_version && `floor ${one.min_version}`].filter(Boolean).join(" · ");
  return (
    <tr data-bundle={one.path} data-over={one.withdrawn !== null}>
      <td class="cell-name"><b class="wrap">{one.name}</b><span class="sub">{one.kind === "agent" ? "the agent itself" : "a node"}{needs && ` · ${needs}`}</span></td>
      <td class="num" data-label="Version">{one.version}</td>
      <td data-label="State">
        {one.withdrawn !== null ? <Badge tone="bad">withdrawn</Badge> : one.signed ? <Badge tone="good">ready</Badge> : <Badge tone="warn">not signed</Badge>}
        {one.withdrawn !== null && one.reason && <span class="sub">{one.reason}</span>}
        {one.withdrawn === null && !one.signed && <span class="sub">robots cannot have it yet</span>}
      </td>
      <td class="end num" data-label="Size">{bytes(one.size_bytes)}</td>
      <td data-label="Uploaded" title={one.uploaded}>{ageText(now.value - Date.parse(one.uploaded))} ago<span class="sub">{one.uploaded_by}</span></td>
      <td class="end cell-actions">
        {one.withdrawn === null && can("updates.publish") && <button type="button" class="button" aria-label={`Withdraw ${one.name} ${one.version}`} onClick={onWithdraw}>Withdraw…</button>}
      </td>
    </tr>
  );
}

const withdrawQuestion = (one: Bundle, done: () => Promise<void>): Question => ({
  title: `Withdraw ${one.name} ${one.version}?`,
  text: <p>No gateway of this store hands it out from now on, and no rollout brings it. Robots that run it keep it until they are given another. This cannot be taken back.</p>,
  yes: "Withdraw",
  reason: "Why",
  run: async (reason) => {
    await rolloutsApi.withdraw(one.path, reason);
    await done();
  },
});

/** What is signed ends; whoever has its keys has to sign again before. */
function Roles({ roles }: { roles: SignedRole[] }) {
  return (
    <>
      <div class="section-head"><h2>Signatures</h2></div>
      <dl class="roles">
        {roles.map(({ role, version, expires, online }) => {
          const leftS = (Date.parse(expires) - now.value) / 1000;
          return (
            <div key={role} data-role={role}>
              <dt><b>{role}</b> <small class="num">version {version}</small></dt>
              <dd>
                {leftS <= 0 ? <Badge tone="bad">ended {duration(-leftS)} ago</Badge> : leftS < SOON_S && !online ? <Badge tone="warn">ends in {duration(leftS)}</Badge> : <Badge tone="good">counts for {duration(leftS)}</Badge>}
                <small>{online ? "the gateway signs it again by itself" : "people sign it, offline"}</small>
              </dd>
            </div>
          );
        })}
      </dl>
    </>
  );
}

function Nothing() {
  return (
    <>
      <p class="nothing">No version is uploaded yet. Bundles are signed by people, on a machine of their own, and published from there:</p>
      <pre class="example">metaros update add ~/updates lidar-node-1.2.0.zip{"\n"}metaros update sign ~/updates targets{"\n"}metaros update publish ~/updates</pre>
    </>
  );
}
