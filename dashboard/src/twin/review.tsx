/** The end of an edit: where it is to count, how long robots may try it, what it would change, and then the deed. */

import { useComputed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { TextField } from "../admin/fields";
import { Refusal, useAttempt } from "../admin/modal";
import { twinApi, type Twin, type TwinChange } from "../api/twin";
import { duration } from "../ui/format";
import { writeJson } from "../values/json";
import { ChangeList } from "./change_list";
import { patchBetween } from "./document";
import { drafted, draftProblem, untouched, type Draft } from "./draft";

const WINDOWS_S = [15, 60, 300, 1800];
const LISTED = 50;

interface ReviewProps {
  twin: Twin;
  draft: Draft;
  moved: boolean;
  onCancel: () => void;
  onApplied: () => Promise<void>;
}

export function Review({ twin, draft, moved, onCancel, onApplied }: ReviewProps) {
  const many = useSignal(false);
  const selector = useSignal("");
  const reason = useSignal("");
  const windowS = useSignal(60);
  const tried = useSignal<{ for: string; results: TwinChange[]; robots: number } | null>(null);
  const { busy, problem, attempt } = useAttempt();
  const document = drafted(draft);
  const wanted = useComputed(() => (many.value ? selector.value.trim() : ""));
  const stamp = `${writeJson(document)} ${many.value} ${wanted.value} ${draft.edition}`;
  const shown = tried.value?.for === stamp ? tried.value : null; // a plan counts for what it was made for
  const blocked = draftProblem(draft) || (untouched(draft) ? "Nothing is changed yet." : "") || (many.value && wanted.value === "" ? "Say which robots." : "");

  const go = (dryRun: boolean) => {
    const options = { dryRun, reason: reason.value.trim(), confirmWithinS: windowS.value };
    if (many.value) return twinApi.patchMany(wanted.value, patchBetween(draft.base, document), options);
    return twinApi.put(twin.robot, document, { ...options, seen: draft }).then((one) => ({ robots: 1, results: [one] }));
  };
  const look = () =>
    attempt(async () => {
      const { robots, results } = await go(true);
      tried.value = { for: stamp, robots, results };
    });
  const apply = () =>
    attempt(async () => {
      await go(false);
      await onApplied();
    });
  useEffect(() => {
    problem.value = ""; // it was about another document
  }, [stamp]);
  const changed = shown?.results.filter((one) => one.changed) ?? [];
  return (
    <form class="review" onSubmit={(event) => { event.preventDefault(); if (!blocked && !moved) void (shown ? apply() : look()); }}>
      <div class="fields">
        <fieldset class="field">
          <legend>Where</legend>
          <div class="segments" role="group">
            <button type="button" aria-pressed={!many.value} onClick={() => (many.value = false)}>{twin.robot}</button>
            <button type="button" aria-pressed={many.value} onClick={() => (many.value = true)}>Several robots</button>
          </div>
        </fieldset>
        {many.value && <TextField label="Which robots" hint="site=lab, model in (a, b), robot!=arm_1: all must hold" placeholder="label=value" mono most={1000} value={selector.value} onInput={(text) => (selector.value = text)} />}
        <TextField label="Reason" note="for the history" most={200} value={reason.value} onInput={(text) => (reason.value = text)} />
        <fieldset class="field">
          <legend>Goes back by itself after</legend>
          <div class="segments" role="group">
            {WINDOWS_S.map((seconds) => <button key={seconds} type="button" aria-pressed={windowS.value === seconds} onClick={() => (windowS.value = seconds)}>{duration(seconds)}</button>)}
          </div>
        </fieldset>
      </div>
      {shown && <Plan shown={shown.results} robots={shown.robots} changed={changed} windowS={windowS.value} />}
      <Refusal text={problem.value} />
      <div class="dialog-end">
        <span class="hint" role="status">{blocked}</span>
        <button type="button" class="button" onClick={onCancel}>Cancel</button>
        {shown ? (
          <button class="button button-solid" disabled={busy.value || changed.length === 0 || moved}>Apply to {changed.length === 1 ? changed[0]!.robot : `${changed.length} robots`}</button>
        ) : (
          <button class="button button-solid" disabled={busy.value || blocked !== "" || moved}>Show what would change</button>
        )}
      </div>
    </form>
  );
}

interface PlanProps {
  shown: TwinChange[];
  robots: number;
  changed: TwinChange[];
  windowS: number;
}

/** What was tried and not done. Robots that would change alike stand together. */
export function Plan({ shown, robots, changed, windowS }: PlanProps) {
  const groups = new Map<string, { names: string[]; one: TwinChange }>();
  for (const one of changed) {
    const id = JSON.stringify([one.changes, one.own_changes]);
    const group = groups.get(id) ?? { names: [], one };
    group.names.push(one.robot);
    groups.set(id, group);
  }
  return (
    <section class="plan" aria-label="What would change" data-plan={changed.length} role="status">
      <h3>
        {changed.length === 0 ? "Nothing would change." : robots === 1 ? `${changed[0]!.robot} would change:` : `${changed.length} of ${robots} robots would change:`} <small>nothing is stored yet</small>
      </h3>
      {[...groups.values()].map(({ names, one }) => (
        <div key={names[0]} class="plan-group">
          {shown.length > 1 && <p class="wrap"><b>{names.slice(0, LISTED).join(", ")}</b>{names.length > LISTED && ` and ${names.length - LISTED} more`}</p>}
          <ChangeList
            changes={one.changes.length > 0 ? one.changes : one.own_changes}
            more={one.more}
          />
          {one.changes.length === 0 && one.own_changes.length > 0 && <p class="hint">Only the robot's own part changes; what it lives by stays as templates have it already.</p>}
        </div>
      ))}
      {changed.length > 0 && <p class="hint">Each robot tries it for at most {duration(windowS)}: if its link does not hold in the new state, it goes back by itself.</p>}
    </section>
  );
}
