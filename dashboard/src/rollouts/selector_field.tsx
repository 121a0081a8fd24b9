/** Which robots: terms over labels, the labels that there are, and the robots that are named. */

import { TextField } from "../admin/fields";
import { robots } from "../live/fleet";
import { SelectedRobotsList, useSelectedRobots } from "./selected_robots";
import { labelsOf, withTerm } from "./words";

const LABELS = 12;

export function SelectorField({ value, onInput }: { value: string; onInput: (selector: string) => void }) {
  const named = useSelectedRobots(value.trim());
  const labels = labelsOf(robots.value ?? [], LABELS);
  return (
    <>
      <TextField label="Robots" mono placeholder="every robot" hint="Terms that all hold: site=lab, kind in (arm, cart), stage!=old, robot=sim_1. Empty: every robot." value={value} onInput={onInput} />
      {labels.length > 0 && (
        <div class="label-chips" role="group" aria-label="Labels of robots">
          {labels.map(({ term, robots: count }) => (
            <button key={term} type="button" class="chip" aria-pressed={value.split(",").some((part) => part.trim() === term)} onClick={() => onInput(withTerm(value, term))}>
              {term} <small class="num">{count}</small>
            </button>
          ))}
        </div>
      )}
      <SelectedRobotsList named={named.value} />
    </>
  );
}
