/** What the gateway watches of a robot: how far each series is learned, how strange it is now, what is expected. */

import { Refusal } from "../../admin/modal";
import { useAsked } from "../../admin/use_list";
import { alertsApi, type SeriesWatch } from "../../api/alerts";
import { robots } from "../../live/fleet";
import { Link } from "../../ui/parts";
import { place, robotHref, setParam } from "../../ui/url";
import { expectedText, unitOf } from "../units";
import { isLearning, learningText, strangestFirst } from "../words";

const EVERY_MS = 4000;
const SHOWN = 300;

export function LearningPart() {
  const names = (robots.value ?? []).map(({ id }) => id).sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
  const asked = place.value.params.get("robot") ?? "";
  const robot = asked || names[0] || "";
  const text = place.value.params.get("q") ?? "";
  if (robots.value === null) return <p class="quiet">Waiting for the gateway…</p>;
  if (!robot) return <p class="nothing">There is no robot yet to learn from.</p>;
  return (
    <>
      <div class="alert-filters" role="search">
        <select aria-label="Robot" value={robot} onChange={(event) => setParam("robot", event.currentTarget.value)}>
          {!names.includes(robot) && <option value={robot}>{robot}</option>}
          {names.map((name) => <option key={name} value={name}>{name}</option>)}
        </select>
        <label class="search">
          <span class="visually-hidden">Search series</span>
          <input type="search" placeholder="Search   /" value={text} onInput={(event) => setParam("q", event.currentTarget.value)} />
        </label>
      </div>
      <SeriesTable key={robot} robot={robot} text={text} />
    </>
  );
}

function SeriesTable({ robot, text }: { robot: string; text: string }) {
  const asked = useAsked(() => alertsApi.watch(robot), EVERY_MS);
  const list = asked.value.value;
  if (list === null) return asked.problem.value ? <Refusal text={asked.problem.value} /> : <p class="quiet">Asking the gateway…</p>;
  const found = strangestFirst(list).filter(({ series }) => series.toLowerCase().includes(text.toLowerCase()));
  return (
    <>
      <p class="learning-head" data-learning={robot}><Link href={robotHref(robot)} class="name-link">{robot}</Link> {learningText(list)}</p>
      <Refusal text={asked.problem.value} />
      {list.length === 0 ? <p class="nothing">Nothing of {robot} is watched yet. Series appear here as the robot sends numbers.</p> : (
        <table class="admin-table learning">
          <thead>
            <tr>
              <th scope="col">Series</th>
              <th scope="col">Learned from</th>
              <th scope="col">Strange now</th>
              <th scope="col">Expected</th>
            </tr>
          </thead>
          <tbody>{found.slice(0, SHOWN).map((one) => <SeriesRow key={one.series} one={one} />)}</tbody>
        </table>
      )}
      {list.length > 0 && found.length === 0 && <p class="quiet">No series is called like that.</p>}
      {found.length > SHOWN && <p class="hint under">and {found.length - SHOWN} more: search for them.</p>}
    </>
  );
}

function SeriesRow({ one }: { one: SeriesWatch }) {
  const unit = unitOf(one.series);
  const part = Math.min(1, one.of > 0 ? one.seen / one.of : 1);
  const expected = isLearning(one) ? "" : expectedText(one.low, one.high, unit);
  return (
    <tr data-series-row={one.series}>
      <td class="cell-name"><b>{unit.title}</b>{unit.title !== one.series && <span class="sub mono">{one.series}</span>}</td>
      <td data-label="Learned from">
        {isLearning(one) ? (
          <>
            <span class="num">{one.seen.toLocaleString("en")} of {one.of.toLocaleString("en")} samples</span>
            <span class="meter" role="progressbar" aria-label={`${one.series} learned`} aria-valuenow={Math.round(part * 100)} aria-valuemin={0} aria-valuemax={100}><i style={{ transform: `scaleX(${part})` }} /></span>
          </>
        ) : <span class="num">{one.seen.toLocaleString("en")} samples</span>}
      </td>
      <td data-label="Strange now"><Strangeness score={one.score} /></td>
      <td data-label="Expected" class="num">{expected || <span class="none">{isLearning(one) ? "learning" : "–"}</span>}</td>
    </tr>
  );
}

/** A score from 0 to 1; from one half on it is an alert. */
function Strangeness({ score }: { score: number }) {
  const word = score >= 0.5 ? "very" : score >= 0.25 ? "somewhat" : "no";
  return (
    <span class="strange" data-strange={word} title={score.toFixed(2)}>
      <span class="meter" aria-hidden="true"><i style={{ transform: `scaleX(${Math.min(1, score)})` }} /></span> {word}
    </span>
  );
}
