/** The robots of a rollout: filtered by state and text, a few hundred at a time. */

import { useSignal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { Badge } from "../admin/badge";
import type { Member, MemberState } from "../api/rollouts";
import { ageText, now } from "../live/age";
import { NONE } from "../ui/format";
import { Link } from "../ui/parts";
import { place, robotHref, setParam } from "../ui/url";
import { foundAmong, MEMBER_TONES, MEMBER_WORDS, worstFirst } from "./words";

const SHOWN = 200;
const STATES = Object.keys(MEMBER_WORDS) as MemberState[];

export function RolloutRobotTable({ members, counts }: { members: Member[]; counts: Record<MemberState, number> }) {
  const most = useSignal(SHOWN);
  const asked = place.value.params.get("state") ?? "";
  const state = (STATES as string[]).includes(asked) ? asked : "";
  const text = place.value.params.get("q") ?? "";
  const sorted = useMemo(() => worstFirst(members), [members]);
  const found = useMemo(() => foundAmong(sorted, state, text), [sorted, state, text]);
  return (
    <>
      <div class="section-head members-head">
        <h2>Robots</h2>
        <div class="segments" role="group" aria-label="State">
          <button type="button" aria-pressed={state === ""} onClick={() => setParam("state", "")}>all <small class="num">{members.length}</small></button>
          {STATES.filter((one) => counts[one] > 0 || one === state).map((one) => (
            <button key={one} type="button" aria-pressed={state === one} onClick={() => setParam("state", one)}>
              {MEMBER_WORDS[one]} <small class="num">{counts[one]}</small>
            </button>
          ))}
        </div>
        <label class="search">
          <span class="visually-hidden">Search robots</span>
          <input type="search" placeholder="Search   /" value={text} onInput={(event) => setParam("q", event.currentTarget.value)} />
        </label>
      </div>
      {found.length === 0 ? <p class="quiet">No robot of it is so.</p> : (
        <table class="admin-table members">
          <thead>
            <tr>
              <th scope="col">Robot</th>
              <th scope="col">State</th>
              <th scope="col" class="end">Wave</th>
              <th scope="col">For</th>
              <th scope="col">Why</th>
            </tr>
          </thead>
          <tbody>{found.slice(0, most.value).map((member) => <MemberRow key={member.robot} member={member} />)}</tbody>
        </table>
      )}
      {found.length > most.value && (
        <p class="members-end">
          <button type="button" class="button" onClick={() => (most.value += SHOWN)}>{SHOWN} more of {(found.length - most.value).toLocaleString("en")}</button>
        </p>
      )}
    </>
  );
}

function MemberRow({ member: { robot, state, wave, since, reason } }: { member: Member }) {
  return (
    <tr data-member={robot} data-member-state={state}>
      <td class="cell-name"><Link class="name-link" href={robotHref(robot)}>{robot}</Link></td>
      <td data-label="State"><Badge tone={MEMBER_TONES[state]}>{MEMBER_WORDS[state]}</Badge></td>
      <td class="end num" data-label="Wave">{wave || NONE}</td>
      <td class="num" data-label="For" title={since}>{ageText(now.value - Date.parse(since))}</td>
      <td class={state === "failed" ? "cell-wide wrap bad" : "cell-wide wrap"} data-label="Why">{reason || <span class="none">{NONE}</span>}</td>
    </tr>
  );
}
