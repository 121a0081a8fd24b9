import { expect, test } from "vitest";
import type { Alert, AlertCheck, SeriesWatch } from "../api/alerts";
import { isOnAxis, ownBounds, reach, rememberedOf, usualAround, windowOf } from "./timeline/band";
import { changeOf, formOf, isWrong } from "./checks/check_form";
import { filterOf, isFiltered, lets } from "./filter";
import { lanesOf, MOST_ROWS } from "./timeline/lanes";
import { expectedText, unitOf, valueText } from "./units";
import { causeWords, checkWords, historyOf, lastsText, learningText, mostUrgentFirst, remarkWords, silencedWords, strangestFirst, worstOf } from "./words";

const T0 = Date.parse("2026-11-22T12:00:00Z");
const at = (seconds: number) => new Date(T0 + seconds * 1000).toISOString();
const alert = (id: string, changes: Partial<Alert> = {}): Alert => ({
  id, robot: "sim_1", cause: "heat", state: "open", severity: "warning", title: "Too hot", reason: "", series: "", detector: "motor_hot", score: 0.8, value: null,
  low: null, high: null, opened: at(0), first: at(0), changed: at(0), seen: at(0), clearing: null, resolved: null, resolved_by: "", acknowledged: null,
  acknowledged_by: "", assignee: "", times: 1, clip: "", inhibited_by: "", silence: "", quiet: false, gateway: "", revision: 1, path: "", ...changes,
});
const check: AlertCheck = {
  id: "motor_hot", title: "Motor is hot", unit: "°C", enabled: true, low: null, high: 80, for_s: 5, clear_s: 30, severity: "warning", changed: [], changed_by: "", changed_at: null,
};
const series = (name: string, changes: Partial<SeriesWatch> = {}): SeriesWatch => ({ series: name, seen: 750, of: 750, score: 0, low: null, high: null, ...changes });

test("what goes on comes before what is over, what is told before what is quiet, the worst and the newest first", () => {
  const found = mostUrgentFirst([
    alert("over", { state: "resolved", severity: "error", resolved: at(9) }),
    alert("quiet", { severity: "error", quiet: true }),
    alert("old"),
    alert("new", { opened: at(5) }),
    alert("seen_to", { state: "acknowledged", severity: "error" }),
    alert("bad", { severity: "error" }),
  ]);
  expect(found.map(({ id }) => id)).toEqual(["bad", "seen_to", "new", "old", "quiet", "over"]);
  expect(worstOf(found)).toBe("error");
  expect(worstOf([])).toBe("info");
});

test("causes, durations, bounds and remarks are words", () => {
  expect(causeWords("heat")).toBe("temperature");
  expect(causeWords("rate:/sim_1/scan")).toBe("rate of a topic /sim_1/scan");
  expect(causeWords("odd_one")).toBe("odd one");
  expect(lastsText(alert("a"), T0 + 90_000)).toBe("for 90\u202fs");
  expect(lastsText(alert("a", { resolved: at(600) }), T0 + 9e9)).toBe("10\u202fmin");
  const charge = unitOf("battery_state.percentage");
  expect([expectedText(0.2, null, charge), expectedText(null, 0.9, charge), expectedText(0.2, 0.9, charge), expectedText(0.5, 0.5, charge), expectedText(null, null, charge)]).toEqual([
    "at least 20\u202f%", "at most 90\u202f%", "20 to 90\u202f%", "50\u202f%", "",
  ]);
  expect(valueText(0.14, charge)).toBe("14\u202f%");
  expect(unitOf("a.b")).toMatchObject({ title: "a.b", factor: 1, unit: "" });
  expect([remarkWords({ by: "ada", kind: "acknowledged" }), remarkWords({ by: "", kind: "resolved" }), remarkWords({ by: "", kind: "opened" }), remarkWords({ by: "bo", kind: "odd_kind" })]).toEqual([
    "ada acknowledged it", "It resolved by itself", "It began", "bo odd kind",
  ]);
  expect(silencedWords({ robots: [], causes: ["heat", "battery"] })).toBe("every robot · heat, battery");
});

test("a check says when it is an alert", () => {
  expect(checkWords(check)).toBe("above 80\u202f°C for 5\u202fs");
  expect(checkWords({ ...check, low: -5 })).toBe("below -5\u202f°C or above 80\u202f°C for 5\u202fs");
  expect(checkWords({ ...check, high: null, for_s: 30 })).toBe("after 30\u202fs");
  expect(checkWords({ ...check, high: null, for_s: 0 })).toBe("at once");
});

test("learning is told by the series that knows least", () => {
  const half = series("b", { seen: 62 });
  expect(learningText([])).toBe("nothing is watched yet");
  expect(learningText([half])).toBe("learning, 62 of 750 samples");
  expect(learningText([series("a"), half])).toBe("learning 1 of 2 series, 62 of 750 samples");
  expect(learningText([series("a"), series("c")])).toBe("knows all 2 series");
  expect(strangestFirst([series("a"), half, series("c", { score: 0.9 }), series("d", { score: 0.05 })]).map((one) => one.series)).toEqual(["c", "b", "a", "d"]);
});

test("a lane has its robot's bars, one row for those that do not overlap, and never too many rows", () => {
  const window = { startMs: T0, endMs: T0 + 1_000_000 };
  const lanes = lanesOf(
    [
      alert("a", { robot: "r2", first: at(100), resolved: at(200), state: "resolved" }),
      alert("b", { robot: "r2", first: at(150), resolved: at(300), state: "resolved" }),
      alert("c", { robot: "r2", first: at(400), resolved: at(500), state: "resolved" }),
      alert("d", { robot: "r10", first: at(-500), severity: "error" }),
      alert("early", { robot: "r3", first: at(-500), resolved: at(-1), state: "resolved" }),
      alert("late", { robot: "r3", first: at(2000) }),
    ],
    window,
  );
  expect(lanes.map(({ robot, rows }) => [robot, rows])).toEqual([["r10", 1], ["r2", 2]]);
  expect(lanes[0]!.bars[0]).toMatchObject({ from: 0, to: 1 });
  expect(lanes[1]!.bars.map(({ alert: { id }, row }) => [id, row])).toEqual([["a", 0], ["b", 1], ["c", 0]]);
  const storm = Array.from({ length: 20 }, (_, i) => alert(String(i)));
  expect(lanesOf(storm, window)[0]!.rows).toBe(MOST_ROWS);
});

test("the address says what is shown, and what it does not know is nothing", () => {
  const filter = filterOf(new URLSearchParams("state=resolved&severity=odd&q=Hot+sim"));
  expect(filter).toEqual({ state: "resolved", severity: "", robot: "", text: "Hot sim" });
  expect(isFiltered(filterOf(new URLSearchParams()))).toBe(false);
  expect(lets(alert("a", { state: "resolved" }), filter)).toBe(true);
  expect(lets(alert("a"), filter)).toBe(false);
  expect(lets(alert("a"), filter, true)).toBe(true);
  expect(lets(alert("a", { state: "resolved", robot: "arm" }), filter)).toBe(false);
  const going = filterOf(new URLSearchParams("robot=sim_1"));
  expect([alert("a"), alert("b", { state: "acknowledged" }), alert("c", { state: "resolved" }), alert("d", { robot: "x" })].filter((one) => lets(one, going)).map(({ id }) => id)).toEqual(["a", "b"]);
});

test("the plot reaches around the moment and never beyond now", () => {
  expect(usualAround(alert("a"), T0 + 60_000)).toBe("15m");
  expect(usualAround(alert("a"), T0 + 30 * 60_000)).toBe("1h");
  expect(usualAround(alert("a"), T0 + 9e8)).toBe("6h");
  expect(windowOf(T0, 900_000, T0 + 60_000)).toEqual({ startMs: T0 - 840_000, endMs: T0 + 60_000 });
  const later = windowOf(T0, 900_000, T0 + 9e8);
  expect([later.endMs - later.startMs, later.endMs - T0]).toEqual([900_000, 558_000]);
});

test("a band that is far from all values is none; the alert's own bounds stand over the whole plot", () => {
  const points: [number, number | null, number | null, number | null, number][] = [[T0, 0.5, 0.4, 0.6, 0], [T0 + 500, 0.9, null, 0.6, 0.8], [T0 + 600, 0.9, null, null, 0], [T0 + 700, 0.9, -9, 9, 0]];
  expect(rememberedOf(points, [50, 90], 100)).toEqual([
    { stampMs: T0, value: 50, low: 40, high: 60, score: 0 },
    { stampMs: T0 + 500, value: 90, low: -Infinity, high: 60, score: 0.8 },
  ]);
  expect(rememberedOf(points, [], 100).length).toBe(3);
  const window = { startMs: T0, endMs: T0 + 1000 };
  expect(ownBounds({ low: null, high: 0.6 }, window, 100).map(({ stampMs, low, high }) => [stampMs, low, high])).toEqual([[T0, -Infinity, 60], [T0 + 1000, -Infinity, 60]]);
  expect(ownBounds({ low: null, high: null }, window, 1)).toEqual([]);
});

test("numbers of a check of how fast a value changes are not on the value's axis", () => {
  expect([isOnAxis(96, [40, null, 97]), isOnAxis(1.05, [40, 70]), isOnAxis(null, [40]), isOnAxis(5, [])]).toEqual([true, false, true, true]);
});

test("an axis holds all values, and of the band what is not far away", () => {
  const [low, high] = reach([20, null, 30], [{ stampMs: 0, value: null, low: 10, high: 1e6, score: 0 }]);
  expect([low < 10, high > 30, high < 40]).toEqual([true, true, true]);
  expect(reach([], [])).toEqual([0, 1.1]);
  expect(reach([5, 5], [])[1]).toBeGreaterThan(5);
});

test("its history begins with it, and ends with it where nobody did", () => {
  const remark = { number: 1, at: at(5), by: "ada", kind: "acknowledged", text: "" };
  const kinds = (resolved: string | null, remarks = [remark]) => historyOf({ opened: at(0), resolved, resolved_by: "", remarks }).map(({ kind }) => kind);
  expect(kinds(null)).toEqual(["opened", "acknowledged"]);
  expect(kinds(at(9))).toEqual(["opened", "acknowledged", "resolved"]);
  expect(kinds(at(9), [{ ...remark, at: at(9), kind: "resolved" }])).toEqual(["opened", "resolved"]);
});

test("a check's form sends what is another, and nothing while a field is wrong", () => {
  const form = formOf(check);
  expect(changeOf(check, form)).toEqual({});
  expect(changeOf(check, { ...form, high: "85", severity: "error", enabled: false })).toEqual({ high: 85, severity: "error", enabled: false });
  expect(changeOf(check, { ...form, high: "hot", severity: "error" })).toEqual({});
  expect([isWrong("", "high"), isWrong("", "for_s"), isWrong("-1", "for_s"), isWrong("-1", "low"), isWrong("1e9", "clear_s")]).toEqual([false, true, true, false, true]);
});
