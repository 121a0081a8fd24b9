"""Rows of all series, cut into cells of one second by their own stamps.

A cell is closed when its robot has rows of a later second, so that neither the way the rows were cut into calls nor
the order of the robots changes what the detectors see. A second is judged for all robots at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["Cells", "Second"]

LATE_ROWS = 600  # so many late rows of a series, with none in time between, are a clock that was set back
FARTHEST_S = 1e11  # stamps beyond the year 5000 are no stamps
LARGEST = 1e100  # values beyond are no values: their squares would be infinite, and what is learned of them with it
SECONDS_AT_ONCE = 300  # of one robot: what comes late in one piece is judged in several, and the others' beside it


@dataclass(frozen=True, slots=True)
class Second:
    """The cells of one second: a row a series. `mark` is its value that lies farthest from the mean."""

    at_s: float
    slots: Ints
    count: Floats
    mean: Floats
    low: Floats
    high: Floats
    last: Floats
    spread: Floats
    mark: Floats
    stamp_s: Floats

    def where(self, mask: Bools) -> Second:
        """The cells of some rows."""
        columns = (self.count, self.mean, self.low, self.high, self.last, self.spread, self.mark, self.stamp_s)
        return Second(self.at_s, self.slots[mask], *(column[mask] for column in columns))


class Cells:
    """Collects rows and gives the closed seconds, oldest first."""

    def __init__(self, *, pending_rows: int = 2**20) -> None:
        """At most `pending_rows` wait for the next `seconds`, and as many for their second's end; of more the oldest
        are dropped and counted.
        """
        self._pending_rows = pending_rows
        self._rows: list[tuple[Ints, Floats, Floats]] = []  # new ones
        self._open = (np.empty(0, np.int64), np.empty(0), np.empty(0))  # of seconds that are not closed
        self._waiting = 0
        self._behind = False  # whether closed seconds are left for the next time
        self.dropped = 0
        self.slots = Columns(
            robot=np.int64(-1), done_s=np.float64(-np.inf), late=np.int64(0), ignored=np.int64(0), all_late=np.int64(0)
        )
        self.robots = Columns(newest_s=np.float64(-np.inf))

    def add(self, slots: Ints, stamps_s: Floats, values: Floats) -> None:
        """Take rows in; nothing is looked at yet."""
        self._rows.append((slots, stamps_s, values))
        self._waiting += len(slots)
        while self._waiting > self._pending_rows and len(self._rows) > 1:
            gone = len(self._rows.pop(0)[0])
            self._waiting -= gone
            self.dropped += gone

    def seconds(self) -> Iterator[Second]:
        """Closed seconds in order, of each robot `SECONDS_AT_ONCE` at most; what is not closed stays."""
        if not self._rows and not self._behind:
            return
        slots, stamps, values = (np.concatenate(part) for part in zip(_NO_ROWS, *self._rows, strict=True))
        new = self._usable(slots, stamps, values)
        slots, stamps, values = (np.concatenate(pair) for pair in zip(self._open, new, strict=True))
        at = np.floor(stamps)
        robots = self.slots["robot"][slots]
        newest = self.robots["newest_s"]
        self._settle(robots, at, newest)
        over = at < newest[robots]
        closed = _first_seconds(robots, at, over)
        self._behind = bool((over & ~closed).any())
        self._keep_open(slots[~closed], stamps[~closed], values[~closed])
        self._rows, self._waiting = [], 0
        order = np.lexsort((slots[closed], at[closed]))
        yield from self._cut(at[closed][order], slots[closed][order], stamps[closed][order], values[closed][order])

    def forget(self, slots: Ints) -> None:
        """Rows of these slots are not wanted any more."""
        self._rows = [_without(rows, slots) for rows in self._rows]
        self._open = _without(self._open, slots)
        self._waiting = sum(len(rows[0]) for rows in self._rows)
        self.slots.reset(slots)

    def take(self, slots: Ints) -> dict[str, npt.NDArray[Any]]:
        """The waiting rows of some slots; `at` says of which of them. Between two times that seconds were taken."""
        rows = np.flatnonzero(np.isin(self._open[0], slots))
        order = np.argsort(slots)
        at = order[np.searchsorted(slots[order], self._open[0][rows])] if len(rows) else rows
        return {"at": at, "stamps": self._open[1][rows], "values": self._open[2][rows]}

    def put(self, slots: Ints, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Have the rows that `take` gave wait for these slots. Raises KeyError, IndexError and ValueError."""
        new = (slots[arrays["at"]], arrays["stamps"], arrays["values"])
        opened, stamps, values = (np.concatenate(pair) for pair in zip(self._open, new, strict=True))
        self._open, self._behind = (opened, stamps, values), True

    def dump(self) -> dict[str, npt.NDArray[Any]]:
        """The rows that wait."""
        parts = [*zip(("slots", "stamps", "values"), self._open, strict=True)]
        new = (np.concatenate(part) for part in zip(_NO_ROWS, *self._rows, strict=True))
        parts += zip(("new_slots", "new_stamps", "new_values"), new, strict=True)
        return {**dict(parts), "dropped": np.array(self.dropped)}

    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take over what `dump` gave. Raises KeyError."""
        self._open = (arrays["slots"], arrays["stamps"], arrays["values"])
        self._rows = [(arrays["new_slots"], arrays["new_stamps"], arrays["new_values"])]
        self._waiting, self.dropped = len(arrays["new_slots"]), int(arrays["dropped"])

    def _keep_open(self, slots: Ints, stamps: Floats, values: Floats) -> None:
        """A clock that stands still closes no second: of its rows the newest stay."""
        first = max(0, len(slots) - self._pending_rows)
        self.dropped += first
        self._open = (slots[first:], stamps[first:], values[first:])

    def _usable(self, slots: Ints, stamps: Floats, values: Floats) -> tuple[Ints, Floats, Floats]:
        """Without what is no number or no time, and without rows of seconds that were judged already."""
        good: Bools = (np.abs(values) < LARGEST) & (np.abs(stamps) < FARTHEST_S)  # NaN is less than nothing
        if not good.all():
            np.add.at(self.slots["ignored"], slots[~good], 1)
            slots, stamps, values = slots[good], stamps[good], values[good]
        late = np.floor(stamps) <= self.slots["done_s"][slots]
        if not late.any():
            self.slots["late"][slots] = 0
            return slots, stamps, values
        np.add.at(self.slots["late"], slots[late], 1)
        np.add.at(self.slots["all_late"], slots[late], 1)
        self.slots["late"][slots[~late]] = 0
        back = np.unique(slots[late & (self.slots["late"][slots] > LATE_ROWS)])
        if len(back):
            self.slots["done_s"][back], self.slots["late"][back] = -np.inf, 0
            self.robots["newest_s"][np.unique(self.slots["robot"][back])] = -np.inf
            self._open = _without(self._open, back)
        return slots[~late], stamps[~late], values[~late]

    @staticmethod
    def _settle(robots: Ints, at: Floats, newest: Floats) -> None:
        np.maximum.at(newest, robots, at)

    def _cut(self, at: Floats, slots: Ints, stamps: Floats, values: Floats) -> Iterator[Second]:
        if not len(at):
            return
        starts = np.flatnonzero(np.r_[True, (np.diff(at) != 0) | (np.diff(slots) != 0)])
        ends = np.r_[starts[1:], len(at)] - 1
        count = (ends - starts + 1).astype(np.float64)
        single = bool((count == 1.0).all())
        low = values if single else np.minimum.reduceat(values, starts)
        high = values if single else np.maximum.reduceat(values, starts)
        mean = (
            values if single else np.clip(np.add.reduceat(values / count.repeat(ends - starts + 1), starts), low, high)
        )
        spread = np.zeros(len(starts))
        if not single:
            apart = values - mean.repeat(ends - starts + 1)
            spread = np.sqrt(np.add.reduceat(apart * apart, starts) / count)
        mark = np.where(high - mean > mean - low, high, low)
        cell_at, cell_slots = at[starts], slots[starts]
        np.maximum.at(self.slots["done_s"], cell_slots, cell_at)
        cuts = np.flatnonzero(np.r_[True, np.diff(cell_at) != 0, True])
        columns = (cell_slots, count, mean, low, high, values[ends], spread, mark, stamps[ends])
        for first, end in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            yield Second(float(cell_at[first]), *(column[first:end] for column in columns))  # type: ignore[arg-type]


def _first_seconds(robots: Ints, at: Floats, over: Bools) -> Bools:
    """Of the rows of seconds that are over those of each robot's first ones."""
    rows = np.flatnonzero(over)
    if len(np.unique(at[rows])) <= SECONDS_AT_ONCE:
        return over
    rows = rows[np.lexsort((at[rows], robots[rows]))]
    other = np.diff(robots[rows], prepend=-1) != 0  # the first row of each robot
    number = np.cumsum(other | (np.diff(at[rows], prepend=-np.inf) != 0))
    place = number - np.repeat(number[other], np.diff(np.r_[np.flatnonzero(other), len(rows)]))
    chosen = np.zeros(len(over), np.bool_)
    chosen[rows[place < SECONDS_AT_ONCE]] = True
    return chosen


def _without(rows: tuple[Ints, Floats, Floats], slots: Ints) -> tuple[Ints, Floats, Floats]:
    """Rows of other slots."""
    kept = ~np.isin(rows[0], slots)
    return rows[0][kept], rows[1][kept], rows[2][kept]


_NO_ROWS = (np.empty(0, np.int64), np.empty(0), np.empty(0))
