/** Every value that is desired, and beside it what the robot has: alike, or what there is instead. */

import { useSignal } from "@preact/signals";
import { Fragment } from "preact";
import { shown } from "../values/value_text";
import { SECTIONS, type Compared, type Mark } from "./compare";

const WORDS: Record<Mark, string> = {
  same: "as desired",
  add: "not there yet",
  remove: "still there",
  change: "differs",
  unknown: "not known",
};
const SHAPES: Record<Mark, string> = {
  same: "M1.600 6.400 3 5l2.200 2.200L9.400 2.800l1.400 1.400L5.200 10Z",
  add: "M5 1h2v4h4v2H7v4H5V7H1V5h4Z",
  remove: "M1 5h10v2H1Z",
  change: "M6 .8 11.600 11H.4Z",
  unknown: "M1.500 1.500h9v9h-9Zm2 2v5h5v-5Z",
};

export function CompareTable({ rows }: { rows: readonly Compared[] }) {
  const onlyOff = useSignal(false);
  const off = rows.filter(({ mark }) => mark !== "same" && mark !== "unknown").length;
  const listed = onlyOff.value ? rows.filter(({ mark }) => mark !== "same" && mark !== "unknown") : rows;
  return (
    <section class="card card-twin" aria-labelledby="twin-title" data-card="twin" data-differs={off}>
      <header>
        <h2 id="twin-title">Desired and real</h2>
        <span class="segments note-end" role="group" aria-label="Rows">
          <button type="button" aria-pressed={!onlyOff.value} onClick={() => (onlyOff.value = false)}>All</button>
          <button type="button" aria-pressed={onlyOff.value} onClick={() => (onlyOff.value = true)}>Differences <span class="num">{off}</span></button>
        </span>
      </header>
      {rows.length === 0 ? (
        <p class="hint pad-in">Nothing is desired of this robot: topics, nodes, parameters and the rest are as its own settings say.</p>
      ) : listed.length === 0 ? (
        <p class="hint pad-in">No differences: the robot is as it is to be.</p>
      ) : (
        <table class="twin-table">
          <thead>
            <tr>
              <th scope="col">Key</th>
              <th scope="col">Desired</th>
              <th scope="col">On the robot</th>
            </tr>
          </thead>
          <tbody>
            {listed.map((row, i) => {
              const before = listed[i - 1];
              const first = before?.section !== row.section || before.name !== row.name;
              return (
                <Fragment key={`${row.section} ${row.name} ${row.key}`}>
                  {first && (
                    <tr class="twin-group">
                      <th scope="rowgroup" colSpan={3}>
                        {SECTIONS[row.section] ?? row.section} {row.name && <span class="mono">{row.name}</span>}
                      </th>
                    </tr>
                  )}
                  <CompareRow row={row} />
                </Fragment>
              );
            })}
          </tbody>
        </table>
      )}
    </section>
  );
}

function CompareRow({ row }: { row: Compared }) {
  const { mark, desired, robot, why, own } = row;
  const alike = mark === "same" && shown(desired) === shown(robot);
  return (
    <tr class={`twin-${mark}`} data-key={[row.section, row.name, row.key].filter(Boolean).join(".")} data-mark={mark}>
      <td class="mono">{row.key || "state"}</td>
      <td class="mono wrap">
        {shown(desired)} {!own && desired !== undefined && <span class="from-template" title="from a template">template</span>}
      </td>
      <td class="wrap">
        <span class="mark">
          <svg viewBox="0 0 12 12" aria-hidden="true"><path d={SHAPES[mark]} fill-rule="evenodd" /></svg>
          {alike ? <span class="visually-hidden">{WORDS.same}</span> : mark === "unknown" || mark === "add" ? WORDS[mark] : <span class="mono">{shown(robot)}</span>}
          {(mark === "change" || mark === "remove") && <small>{WORDS[mark]}</small>}
        </span>
        {why && mark !== "same" && <span class="sub">{why}</span>}
      </td>
    </tr>
  );
}
