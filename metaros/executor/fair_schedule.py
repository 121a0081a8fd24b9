"""Completely fair scheduling of nodes: which runs next, and how long. Pure: run times are passed in, it reads no clock.

The scheme is the one of the Meta-ROS paper, after Linux's Completely Fair Scheduler. With w_i the weight of node i by
its nice level and W_total the weights of all that have work:

    T_i  = T_sched × w_i / W_total        (1)  the slice of node i in one scheduling period
    V_i += (w_base / w_i) × R_real        (2)  its virtual runtime, after it ran for R_real

The node with the least virtual runtime is next. Nodes with work lie on a timeline ordered by it. A node that wakes is
put at most `credit_s` behind the least virtual runtime, so that sleep is not saved up; a node that is behind by less
keeps its place, so that it does not lose either.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from sortedcontainers import SortedKeyList

from metaros.errors import UsageError

__all__ = ["BASE_WEIGHT", "NICE_WEIGHTS", "FairSchedule", "TimeSlice", "weight_of"]

BASE_WEIGHT: Final = 1024  # of nice 0
# The kernel's sched_prio_to_weight: a step of one is a tenth of the CPU, a factor of about 1.25.
NICE_WEIGHTS: Final = dict(
    zip(
        range(-20, 20),
        (
            *(88761, 71755, 56483, 46273, 36291, 29154, 23254, 18705, 14949, 11916),
            *(9548, 7620, 6100, 4904, 3906, 3121, 2501, 1991, 1586, 1277),
            *(1024, 820, 655, 526, 423, 335, 272, 215, 172, 137),
            *(110, 87, 70, 56, 45, 36, 29, 23, 18, 15),
        ),
        strict=True,
    )
)

K = TypeVar("K")


def weight_of(nice: int) -> int:
    """The weight of a nice level; UsageError outside -20 to 19."""
    try:
        return NICE_WEIGHTS[nice]
    except (KeyError, TypeError):
        raise UsageError(f"nice goes from -20 (most) to 19 (least), not {nice!r}") from None


@dataclass(frozen=True, slots=True)
class TimeSlice(Generic[K]):
    """Who is next and its slice by equation (1)."""

    key: K
    slice_s: float


@dataclass(slots=True)
class _Entry(Generic[K]):
    key: K
    nice: int
    weight: int
    order: int
    virtual_s: float
    run_s: float = 0.0
    runnable: bool = False


class FairSchedule(Generic[K]):
    """The timeline of the nodes that have work.

    `period_s` is T_sched: in so long everybody with work has a turn. `credit_s` is how far a node that slept may be
    put before the others, in virtual time.
    """

    def __init__(self, *, period_s: float = 0.02, credit_s: float | None = None) -> None:
        if not 0 < period_s < float("inf"):
            raise UsageError(f"a scheduling period must be a positive number of seconds, not {period_s}")
        self.period_s = period_s
        self.credit_s = period_s / 2 if credit_s is None else credit_s
        self._entries: dict[K, _Entry[K]] = {}
        self._timeline: Any = SortedKeyList(key=lambda entry: (entry.virtual_s, entry.order))
        self._total_weight = 0
        self._least_s = 0.0  # never decreases
        self._count = 0

    def add(self, key: K, *, nice: int = 0) -> None:
        """A node without work yet. It starts where the others are."""
        weight = weight_of(nice)
        if key in self._entries:
            raise UsageError("this node is scheduled already")
        self._count += 1
        self._entries[key] = _Entry(key, nice, weight, self._count, self._least_s)

    def remove(self, key: K) -> None:
        """Forget it."""
        self.sleep(key)
        del self._entries[key]

    def renice(self, key: K, nice: int) -> None:
        """Another nice level, from now on."""
        weight, entry = weight_of(nice), self._entries[key]
        if entry.runnable:
            self._total_weight += weight - entry.weight
        entry.nice, entry.weight = nice, weight

    def wake(self, key: K) -> None:
        """It has work."""
        entry = self._entries[key]
        if not entry.runnable:
            entry.virtual_s = max(entry.virtual_s, self._least_s - self.credit_s)
            entry.runnable = True
            self._total_weight += entry.weight
            self._timeline.add(entry)

    def sleep(self, key: K) -> None:
        """It has no more work."""
        entry = self._entries[key]
        if entry.runnable:
            self._timeline.remove(entry)
            entry.runnable = False
            self._total_weight -= entry.weight

    def pick(self) -> TimeSlice[K] | None:
        """Who is next; None when nobody has work."""
        if not self._timeline:
            return None
        entry: _Entry[K] = self._timeline[0]
        self._least_s = max(self._least_s, entry.virtual_s)
        return TimeSlice(entry.key, self.period_s * entry.weight / self._total_weight)

    def charge(self, key: K, real_s: float) -> None:
        """It ran for so long: equation (2)."""
        entry = self._entries[key]
        if entry.runnable:
            self._timeline.remove(entry)
        entry.run_s += real_s
        entry.virtual_s += BASE_WEIGHT / entry.weight * real_s
        if entry.runnable:
            self._timeline.add(entry)

    def is_runnable(self, key: K) -> bool:
        """Whether it has work."""
        return self._entries[key].runnable

    def nice(self, key: K) -> int:
        """Its nice level."""
        return self._entries[key].nice

    def run_s(self, key: K) -> float:
        """How long it ran in all."""
        return self._entries[key].run_s

    def virtual_s(self, key: K) -> float:
        """Its virtual runtime."""
        return self._entries[key].virtual_s
