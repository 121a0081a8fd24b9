"""The range in which a feature of a series was seen so far, and what lies lastingly outside of it.

A range has a margin: a part of its own width and of the feature's standard deviation, wider while little was seen.
What lies beyond the margin for so many judgements in a row opens; nothing is learnt while it is open, until it lasted
so long that it is the new normal. What was seen enters the range one to two epochs later, at most a margin farther
out than before: a slow drift is held against how things were, and a single spike spoils nothing. Ranges shrink slowly
towards the mean, so that one wild hour is not remembered for ever.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["RangeRule", "Ranges", "Verdict"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeRule:
    """How a feature is judged; all but the first two and `young` are counts of judgements.

    `need` in a row open, `clear` in a row inside close, after `adopt` open ones they are normal.
    """

    part: float
    deviations: float
    need: int
    clear: int
    learn: int
    epoch: int
    adopt: int
    memory: int  # in so many a range shrinks to 1/e
    young: float = 0.0  # how much wider the margin is after `learn` judgements, falling with their square root


@dataclass(frozen=True, slots=True)
class Verdict:
    """Of the rows judged: what opened, what closed, and the band each value was held against."""

    opened: Bools
    closed: Bools
    low: Floats
    high: Floats


class Ranges:
    """One feature over many series, a row each."""

    def __init__(self, rule: RangeRule) -> None:
        self.rule = rule
        zero, none = np.float64(0), np.float64(np.inf)
        self.columns = Columns(
            low=zero, high=zero, mean=zero, var=zero, seen=np.int64(0), out=np.int32(0), inside=np.int32(0),
            least=zero, fresh_low=none, fresh_high=-none, past_low=none, past_high=-none,
            told=np.float64(np.nan),
        )  # fmt: skip

    def evaluate(self, rows: Ints, x: Floats) -> Verdict:
        """Hold one value a row against its range, then learn it."""
        columns, rule = self.columns, self.rule
        low, high = self.band(rows)
        out, inside = columns["out"][rows], columns["inside"][rows]
        outside = ((x < low) | (x > high)) & (columns["seen"][rows] >= rule.learn)
        was_open = out >= rule.need
        out = np.where(outside | was_open, out + 1, 0)
        opened = (out >= rule.need) & ~was_open
        columns["told"][rows] = np.where(outside & (was_open | opened), x, columns["told"][rows])
        if was_open.any():
            inside = np.where(was_open & ~outside, inside + 1, 0)
            adopted = was_open & (out >= rule.adopt)
            closed = (was_open & (inside >= rule.clear)) | adopted
            columns["out"][rows] = np.where(closed, 0, out)
            columns["inside"][rows] = np.where(closed, 0, inside)
            if adopted.any():
                self._adopt(rows[adopted], x[adopted])
            learning = ~(was_open | opened)
            self._learn(rows[learning], x[learning], low[learning], high[learning])
        else:
            columns["out"][rows] = out
            closed = was_open
            self._learn(rows, x, low, high)
        return Verdict(opened, closed, low, high)

    def band(self, rows: Ints) -> tuple[Floats, Floats]:
        """The range with its margins."""
        columns, rule = self.columns, self.rule
        low, high = columns["low"][rows], columns["high"][rows]
        margin = rule.part * (high - low) + rule.deviations * np.sqrt(columns["var"][rows])
        if rule.young:
            margin *= 1.0 + rule.young * np.sqrt(rule.learn / np.maximum(columns["seen"][rows], 1))
        margin = np.maximum(margin, columns["least"][rows]) + 1e-9 * np.abs(high) + 1e-12
        return low - margin, high + margin

    def is_open(self, rows: Ints) -> Bools:
        """Which are open."""
        found: Bools = self.columns["out"][rows] >= self.rule.need
        return found

    def accept(self, row: int, x: float) -> None:
        """This value is normal; what is open is closed by the next judgements inside."""
        self.columns["low"][row] = min(self.columns["low"][row], x)
        self.columns["high"][row] = max(self.columns["high"][row], x)

    def accept_told(self, row: int) -> None:
        """The value that was told last is normal; nothing where none was."""
        bound = float(self.columns["told"][row])
        if np.isfinite(bound):
            self.accept(row, bound)

    def _adopt(self, rows: Ints, x: Floats) -> None:
        """What lasted so long is how it is now."""
        self.columns["low"][rows] = np.minimum(self.columns["low"][rows], x)
        self.columns["high"][rows] = np.maximum(self.columns["high"][rows], x)

    def _learn(self, rows: Ints, x: Floats, low: Floats, high: Floats) -> None:
        columns, rule = self.columns, self.rule
        seen = columns["seen"][rows]
        learning = seen < rule.learn
        if learning.any():
            x = np.where(learning, x, np.clip(x, low, high))
            self._begin(rows[learning], x[learning], seen[learning])
        else:
            x = np.clip(x, low, high)
        old = columns["mean"][rows]
        rate = np.maximum(1.0 / (seen + 1.0), 1.0 / rule.memory)
        columns["mean"][rows] = mean = old + rate * (x - old)
        columns["var"][rows] = (1.0 - rate) * (columns["var"][rows] + rate * (x - old) ** 2)
        columns["seen"][rows] = seen + 1
        columns["fresh_low"][rows] = np.minimum(columns["fresh_low"][rows], x)
        columns["fresh_high"][rows] = np.maximum(columns["fresh_high"][rows], x)
        turning = (seen + 1) % rule.epoch == 0
        if turning.any():
            self._turn(rows[turning], mean[turning])

    def _begin(self, rows: Ints, x: Floats, seen: Ints) -> None:
        """At first everything enters the range at once."""
        low, high = self.columns["low"][rows], self.columns["high"][rows]
        self.columns["low"][rows] = np.where(seen == 0, x, np.minimum(low, x))
        self.columns["high"][rows] = np.where(seen == 0, x, np.maximum(high, x))

    def _turn(self, rows: Ints, mean: Floats) -> None:
        """An epoch is over: the one before it enters the range."""
        columns = self.columns
        shrink = min(1.0, self.rule.epoch / self.rule.memory)
        for side, reach, none in (("low", np.minimum, np.inf), ("high", np.maximum, -np.inf)):
            limit = columns[side][rows]
            columns[side][rows] = reach(limit + shrink * (mean - limit), columns[f"past_{side}"][rows])
            columns[f"past_{side}"][rows] = columns[f"fresh_{side}"][rows]
            columns[f"fresh_{side}"][rows] = none
