"""The odd one out: one robot's metric beside the same metric of the robots like it.

Each series has a slow mean over minutes. Within a cohort of at least four robots the distance of a robot's mean from
the median is held against the median of all distances, and against how far such means wander by themselves. Only what
lies beyond for long is told. Nothing here names another robot: whoever reads of one may not be allowed to see others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["CohortConfig", "CohortVerdict", "Cohorts"]


ACCEPTED = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CohortConfig:
    """The one parameter set. A robot is judged every `period_s` by means over about `memory_s`."""

    least: int = 4
    period_s: float = 60.0
    memory_s: float = 1800.0
    wander_s: float = 86400.0
    fresh_s: float = 300.0
    learn: int = 180
    factor: float = 6.0
    wanders: float = 3.0
    need: int = 20
    clear: int = 20


@dataclass(frozen=True, slots=True)
class CohortVerdict:
    """Slots where something opened or closed; the median, and how far from it is usual."""

    slots: Ints
    opened: Bools
    mean: Floats
    median: Floats
    usual: Floats
    others: Ints


class Cohorts:
    """Slow means of all slots, and the groups they are compared in."""

    def __init__(self, config: CohortConfig = CohortConfig()) -> None:
        self.config = config
        zero = np.float64(0)
        self.columns = Columns(
            group=np.int64(-1), mean=zero, wander=zero, total=zero, count=zero, newest_s=np.float64(-np.inf),
            apart=zero, normal=zero, seen=np.int32(0), out=np.int32(0), inside=np.int32(0),
        )  # fmt: skip
        self.due_s = -np.inf

    def put(self, slots: Ints, values: Floats, at_s: float) -> None:
        """A second's means."""
        self.columns["total"][slots] += values
        self.columns["count"][slots] += 1.0
        self.columns["newest_s"][slots] = at_s

    def evaluate(self, at_s: float) -> CohortVerdict | None:
        """Once a period: all cohorts."""
        config, columns = self.config, self.columns
        if self.due_s - config.period_s <= at_s < self.due_s:
            return None
        self.due_s = at_s + config.period_s
        self._average()
        fresh = np.abs(at_s - columns["newest_s"]) <= config.fresh_s
        slots = self._comparable(np.flatnonzero((columns["group"] >= 0) & (columns["seen"] >= config.learn) & fresh))
        verdicts = [self._compare(slots)] if len(slots) else []
        alone = fresh & (columns["out"] >= config.need)
        alone[slots] = False
        if alone.any():
            verdicts.append(self._let_go(np.flatnonzero(alone)))
        found = [verdict for verdict in verdicts if len(verdict.slots)]
        if len(found) < 2:
            return found[0] if found else None
        return CohortVerdict(*(np.concatenate([getattr(each, name) for each in found]) for name in found[0].__slots__))

    def _comparable(self, slots: Ints) -> Ints:
        """Those whose group is large enough, group by group."""
        if len(slots) < self.config.least:
            return slots[:0]
        slots = slots[np.argsort(self.columns["group"][slots], kind="stable")]
        group = self.columns["group"][slots]
        starts = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
        sizes = np.diff(np.r_[starts, len(slots)])
        large: Ints = slots[np.repeat(sizes >= self.config.least, sizes)]
        return large

    def _let_go(self, slots: Ints) -> CohortVerdict:
        """What is open and can be compared with nobody any more, as the others are elsewhere, is over by and by."""
        columns = self.columns
        inside = columns["inside"][slots] + 1
        over = inside >= self.config.clear
        columns["inside"][slots] = np.where(over, 0, inside)
        gone = slots[over]
        columns["out"][gone] = 0
        mean = columns["mean"][gone]
        return CohortVerdict(
            gone, np.zeros(len(gone), np.bool_), mean, mean, columns["apart"][gone], np.zeros_like(gone)
        )

    def accept(self, slot: int) -> None:
        """As far from the others as it is now, and half as far again, is normal for this one."""
        columns = self.columns
        columns["normal"][slot] = max(float(columns["normal"][slot]), ACCEPTED * float(columns["apart"][slot]))
        columns["out"][slot] = columns["inside"][slot] = 0

    def _average(self) -> None:
        """Take the period's means into the slow ones."""
        config, columns = self.config, self.columns
        rows = np.flatnonzero(columns["count"] > 0.0)
        value = columns["total"][rows] / columns["count"][rows]
        columns["total"][rows] = columns["count"][rows] = 0.0
        seen, old = columns["seen"][rows], columns["mean"][rows]
        rate = np.maximum(1.0 / (seen + 1.0), config.period_s / config.memory_s)
        new = old + rate * (value - old)
        slow = np.maximum(1.0 / (seen + 1.0), config.period_s / config.wander_s)
        wander = columns["wander"][rows]
        columns["mean"][rows] = new
        columns["wander"][rows] = wander + slow * (np.abs(value - new) - wander)
        columns["seen"][rows] = np.minimum(seen + 1, 2**30)

    def _compare(self, slots: Ints) -> CohortVerdict:
        config, columns = self.config, self.columns
        mean = columns["mean"][slots]
        median, size = _median(columns["group"][slots], mean)
        apart = np.abs(mean - median)
        usual, _ = _median(columns["group"][slots], apart)
        wander, _ = _median(columns["group"][slots], columns["wander"][slots])
        allowed = config.factor * 1.4826 * usual + config.wanders * wander + 0.02 * np.abs(median) + 1e-9
        allowed = np.maximum(allowed, columns["normal"][slots])
        outside = apart > allowed
        columns["apart"][slots] = apart
        out = columns["out"][slots]
        was_open = out >= config.need
        out = np.where(outside | was_open, out + 1, 0)
        inside = np.where(was_open & ~outside, columns["inside"][slots] + 1, 0)
        opened, closed = (out >= config.need) & ~was_open, was_open & (inside >= config.clear)
        columns["out"][slots] = np.where(closed, 0, np.minimum(out, 2**30))
        columns["inside"][slots] = np.where(closed, 0, inside)
        edge = opened | closed
        return CohortVerdict(slots[edge], opened[edge], mean[edge], median[edge], allowed[edge], size[edge] - 1)

    def dump(self) -> dict[str, npt.NDArray[Any]]:
        """All state."""
        return {**self.columns.dump(), "due_s": np.array(self.due_s)}

    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take over what `dump` gave. Raises ValueError and KeyError."""
        self.due_s = float(arrays["due_s"])
        self.columns.load({name: array for name, array in arrays.items() if name != "due_s"})


def _median(group: Ints, x: Floats) -> tuple[Floats, Ints]:
    """The median of each one's group, and the group's size, in the order given."""
    order = np.lexsort((x, group))
    ordered = group[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    sizes = np.diff(np.r_[starts, len(x)])
    middle = (x[order[starts + (sizes - 1) // 2]] + x[order[starts + sizes // 2]]) / 2.0
    place = np.empty(len(x), np.int64)
    place[order] = np.repeat(np.arange(len(starts)), sizes)
    return middle[place], sizes[place]
