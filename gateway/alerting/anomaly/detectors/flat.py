"""Values that froze: bit-identical for longer than the series ever was, while rows keep coming.

Many series rest at some value for hours (a parked robot's speed), so the longest runs are learnt by value: the four
values with the longest ones, and the longest of all others. Where a series comes back to again and again it may rest
for ever; a frozen sensor mostly stops elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["Flat", "FlatVerdict"]

RESTS = 4
RETURNS = 3  # runs at a value that make it one where the series rests
SHORTEST_S = 1.0  # of the runs that are learnt


@dataclass(frozen=True, slots=True)
class FlatVerdict:
    """Slots whose value froze or moves again, how long it was the same, and how long it may be."""

    slots: Ints
    opened: Bools
    run_s: Floats
    allowed_s: Floats
    value: Floats


class Flat:
    """The runs of all slots."""

    def __init__(
        self,
        *,
        shortest_s: float = 4.0,
        factor: float = 3.0,
        changes: int = 1800,
        rows: float = 20,
        longest_s: float = 20.0,
    ) -> None:
        """A run may last `shortest_s` and `rows`, or `factor` times the longest learnt; of what changed often.

        A series that stood for more than `longest_s` at values it does not come back to is not judged.
        """
        self._shortest_s, self._factor, self._changes, self._rows = shortest_s, factor, changes, rows
        self._longest_s = longest_s
        zero, none = np.float64(0), np.float64(np.nan)
        self.columns = Columns(
            value=none, since_s=none, seen_s=zero, rows=zero, changes=np.int32(0), open=np.bool_(False), other_s=zero,
            rest=np.full(RESTS, np.nan), rest_s=np.zeros(RESTS), rest_n=np.zeros(RESTS, np.int32),
        )  # fmt: skip

    def feed(self, second: Second) -> FlatVerdict:
        """Judge a second of some slots."""
        columns, slots, at_s = self.columns, second.slots, second.at_s
        same = (second.low == second.high) & (second.last == columns["value"][slots])
        before_s = columns["seen_s"][slots]
        gone = at_s - before_s
        whole = same & (gone > 0.0) & (gone <= np.maximum(60.0, columns["other_s"][slots]))
        columns["seen_s"][slots] = at_s
        ended = ~whole
        if ended.any():
            self._end(second, ended, before_s[ended])
        run_s = at_s - columns["since_s"][slots]
        allowed_s = self._allowed(slots)
        columns["rows"][slots] = np.where(whole, columns["rows"][slots], 0.0) + second.count
        enough = (columns["rows"][slots] >= self._rows) & (columns["changes"][slots] >= self._changes)
        frozen = whole & (run_s >= allowed_s) & enough
        was = columns["open"][slots]
        columns["open"][slots] = frozen
        edge = frozen != was
        return FlatVerdict(slots[edge], frozen[edge], run_s[edge], allowed_s[edge], second.last[edge])

    def accept(self, slot: int) -> None:
        """The present run is normal."""
        columns = self.columns
        run_s = columns["seen_s"][slot] - columns["since_s"][slot]
        self._learn(np.array([slot]), columns["value"][slot : slot + 1], np.array([run_s]))

    def _allowed(self, slots: Ints) -> Floats:
        columns = self.columns
        often = columns["rest_n"][slots] >= RETURNS
        rest = often & (columns["rest"][slots] == columns["value"][slots][:, None])
        rest_s = columns["rest_s"][slots]
        once_s = np.maximum(columns["other_s"][slots], (rest_s * ~often).max(axis=1))
        longest = np.where(rest.any(axis=1) | (once_s > self._longest_s), np.inf, once_s)
        allowed: Floats = np.maximum(self._shortest_s, self._factor * longest + 2.0)
        return allowed  # for ever where it rests, and where it often stands at any value

    def _end(self, second: Second, ended: Bools, before_s: Floats) -> None:
        """Runs that are over are learnt, unless they were told as frozen; new ones begin."""
        columns, slots = self.columns, second.slots[ended]
        run_s = before_s - columns["since_s"][slots]
        columns["changes"][slots] += np.minimum(columns["changes"][slots] < 2**30, 1)
        learnt = (run_s >= SHORTEST_S) & ~columns["open"][slots]
        if learnt.any():
            self._learn(slots[learnt], columns["value"][slots[learnt]], run_s[learnt])
        columns["value"][slots], columns["since_s"][slots] = second.last[ended], second.at_s

    def _learn(self, slots: Ints, values: Floats, run_s: Floats) -> None:
        """A run enters its value's place, else the least place if it is longer; what it pushes out is one of others."""
        columns = self.columns
        rest, rest_s = columns["rest"][slots], columns["rest_s"][slots]
        known = rest == values[:, None]
        place = np.where(known.any(axis=1), known.argmax(axis=1), rest_s.argmin(axis=1))
        every = np.arange(len(slots))
        kept = known.any(axis=1) | (run_s > rest_s[every, place])
        pushed = np.where(known.any(axis=1), 0.0, np.where(kept, rest_s[every, place], run_s))
        columns["other_s"][slots] = np.maximum(columns["other_s"][slots], pushed)
        rest_s[every, place] = np.where(
            kept, np.maximum(run_s, known[every, place] * rest_s[every, place]), rest_s[every, place]
        )
        rest[every, place] = np.where(kept, values, rest[every, place])
        columns["rest"][slots], columns["rest_s"][slots] = rest, rest_s
        times = np.where(known[every, place], columns["rest_n"][slots, place] + 1, 1)
        columns["rest_n"][slots, place] = np.where(kept, np.minimum(times, 2**20), columns["rest_n"][slots, place])
