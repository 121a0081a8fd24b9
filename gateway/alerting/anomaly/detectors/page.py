"""Some hundred series that are judged together: the arrays of their state, and what a sample does to them."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors import lowest, novelty, profile, window
from gateway.alerting.anomaly.detectors.state import Field, Floats, Rows, State
from gateway.alerting.anomaly.explanation import Explanation, Judged, Learned, band, explain, learned
from gateway.alerting.anomaly.parameters import NOVELTIES, THRESHOLD, BankConfig

__all__ = ["LARGEST", "Page"]

LARGEST = 1e100  # values beyond count as this much: their squares stay finite
_SERIES = (
    Field("stamp_s", "f8", np.nan),  # of the last sample
    Field("elapsed_s", "f8"),  # sum of the steps between samples
    Field("count", "f8"),
    Field("ignored", "i8"),
    Field("times", "f8", 1.0),
    Field("quiet_count", "f8"),  # cool-down lasts until both are reached
    Field("quiet_s", "f8"),
    Field("raised", "f8"),  # recent alerts, each counting less as samples come
    Field("last", "f8", 0.0, (len(Judged._fields),)),
)


class Page:
    """The series of one block of rows. Rows are unique in a call."""

    def __init__(self, config: BankConfig, rows: int) -> None:
        self.config = config
        fields = (*_SERIES, *novelty.fields(config), *profile.fields(config))
        fields += (*window.fields(config), *lowest.fields(config))
        self.state = State(fields, rows)
        self._limit, self._lists = config.limit * config.times, np.arange(len(NOVELTIES))
        self._raised_keeps = config.raised_keeps
        self._learn_s = np.full(len(NOVELTIES), config.learn_s)
        self._learn_s[NOVELTIES.index("profile")] = max(config.learn_s, config.profile_learn_s)

    def reset(self, row: int, *, times: float) -> None:
        """A new series in this row."""
        self.state.reset(row)
        self.state["kept"][row, :, 0] = -np.inf
        self.state["times"][row] = times

    def update(self, rows: Rows, stamps_s: Floats, values: Floats) -> Floats:
        """The score of one sample for each row; samples that are no number are counted and get 0."""
        good = np.isfinite(values) & np.isfinite(stamps_s)
        if good.all():
            return self._update(rows, stamps_s, values)
        scores = np.zeros(len(rows))
        self.state["ignored"][rows[~good]] += 1
        scores[good] = self._update(rows[good], stamps_s[good], values[good])
        return scores

    def _update(self, rows: Rows, stamps_s: Floats, values: Floats) -> Floats:
        values = np.minimum(np.maximum(values, -LARGEST), LARGEST) + 0.0  # no -0.0
        before_s = self.state["elapsed_s"][rows]
        count, elapsed_s = self._pass(rows, stamps_s)
        usual = profile.usual(self.state, self.config, rows, stamps_s, values)
        mean, wide = window.of(self.state, self.config, rows, values, values - usual)
        low = lowest.lowest(self.state, self.config, rows, values)
        x = np.stack((values, mean, wide, low), axis=1)
        strength, nearest, reach = self._evaluate(rows, x, before_s)
        told = np.where(strength[:, 0] >= 1.0, 0, strength.argmax(axis=1))  # a new value is told as such
        one = np.arange(len(rows))
        raised = self.state["raised"][rows] * self._raised_keeps
        ratio = strength.max(axis=1) / (1.0 + self.config.raised * raised)
        scores: Floats = ratio / (1.0 + ratio)
        quiet = (count <= self.state["quiet_count"][rows]) | (elapsed_s < self.state["quiet_s"][rows])
        scores = np.where(quiet, scores * 0.5, scores)
        alerts = np.flatnonzero(scores >= THRESHOLD)
        if alerts.size:
            self.state["quiet_count"][rows[alerts]] = count[alerts] + self.config.cooldown_samples
            self.state["quiet_s"][rows[alerts]] = elapsed_s[alerts] + self.config.cooldown_s
            raised[alerts] += 1.0
        self.state["raised"][rows] = raised
        chosen = (x[one, told], nearest[one, told], reach[one, told], usual)
        self.state["last"][rows] = np.stack((values, scores, told, *chosen), axis=1)
        return scores

    def _pass(self, rows: Rows, stamps_s: Floats) -> tuple[Floats, Floats]:
        """Samples and time so far. A clock that jumps back adds nothing, a gap of years no more than a day."""
        with np.errstate(over="ignore"):  # from one end of all numbers to the other is also more than a day
            step = np.fmax(stamps_s - self.state["stamp_s"][rows], 0.0)  # the first one's, NaN, is 0
        elapsed_s = self.state["elapsed_s"][rows] + np.minimum(step, self.config.longest_step_s)
        count = self.state["count"][rows] + 1.0
        self.state["stamp_s"][rows] = stamps_s
        self.state["elapsed_s"][rows] = elapsed_s
        self.state["count"][rows] = count
        return count, elapsed_s

    def _evaluate(self, rows: Rows, x: Floats, learned_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Strength by its limit, nearest value and reach of each novelty of each row; zeros where it cannot say."""
        known = np.isfinite(x).reshape(-1)
        lists = (rows[:, None] * len(self._lists) + self._lists).reshape(-1)[known]
        looked = x.reshape(-1)[known]
        least = novelty.least_spread(self.state, self.config, rows)
        least = least.repeat(len(self._lists))[known]
        at, nearest, distance, spread = novelty.evaluate(self.state, self.config, lists, looked, least)
        allowed = (self.state["times"][rows] * self._limit).repeat(len(self._lists))[known]
        passed = (learned_s[:, None] >= self._learn_s).reshape(-1)[known]
        ready = passed & (self.state.flat["seen"][lists] >= self.config.learn_samples)
        found = np.zeros((3, known.size))
        reach = spread * allowed
        found[:, known] = np.where(ready, distance / reach, 0.0), nearest, reach
        novelty.learn(self.state, self.config, lists, looked, at, distance, spread)
        strength, near, far = found.reshape(3, *x.shape)
        return strength, near, far

    def accept(self, row: int, value: float, stamp_s: float | None) -> None:
        """The value counts as seen by every novelty."""
        usual = self._usual(row, float(self.state["stamp_s"][row]) if stamp_s is None else stamp_s)
        wide = window.range_with(self.state, row, value)
        for number, x in enumerate((value, value - usual, wide, value)):
            lists, at_value = np.array([row * len(self._lists) + number]), np.array([x])
            if np.isfinite(x) and abs(x) <= LARGEST:
                at, _, distance, _ = novelty.evaluate(self.state, self.config, lists, at_value, np.zeros(1))
                if distance[0] > 0.0:
                    novelty.insert(self.state, self.config, lists, at_value, at)

    def _usual(self, row: int, stamp_s: float) -> float:
        if not np.isfinite(stamp_s):
            return float("nan")
        hour = int(stamp_s % (self.config.bin_s * self.config.bins) / self.config.bin_s)
        return float(self.state["usual"][row, min(hour, self.config.bins - 1)])

    def kept(self, row: int, number: int) -> list[float]:
        """What one novelty of a row has kept, sorted."""
        size = int(self.state["size"][row, number])
        found: list[float] = self.state["kept"][row, number, 1 : size + 1].tolist()
        return found

    def learned(self, row: int) -> Learned:
        """How far a row's learning is."""
        seen, elapsed_s = float(self.state["count"][row]), float(self.state["elapsed_s"][row])
        return learned(self.config, seen=seen, elapsed_s=elapsed_s)

    def explain(self, row: int) -> Explanation:
        """Of the row's last sample."""
        value, score, number, *rest = self.state["last"][row].tolist()
        judged = Judged(value, score, int(number), *rest)
        return explain(self.config, judged, self.kept(row, judged.novelty), self.learned(row))

    def band(self, row: int) -> tuple[float, float]:
        """Where the next value is expected, around the last one."""
        lists, value = np.array([row * len(self._lists)]), self.state["last"][row, :1].copy()
        least = novelty.least_spread(self.state, self.config, np.array([row]))
        _, nearest, _, spread = novelty.evaluate(self.state, self.config, lists, value, least)
        reach = float(spread[0] * self._limit * self.state["times"][row])
        return band(self.kept(row, 0), float(nearest[0]), reach)
