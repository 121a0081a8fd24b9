"""The retention policy: what is to be deleted, by age and size of a class, and by total size, the oldest first. Pure.

Classes are `metric` (rows of series), `bulk` and `event` (messages, as batches or whole segments), `recording`. The
purge and its dry run ask the same plan.
"""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Protocol

from metaros.errors import ConfigError

__all__ = [
    "CLASSES",
    "Bounds",
    "ClassLimit",
    "Holding",
    "PlannedDeletion",
    "Reason",
    "Retention",
    "Usage",
    "class_limits",
    "plan",
    "retention_of",
]

EVENT, RECORDING = "event", "recording"
CLASSES = ("metric", "bulk", EVENT, RECORDING)
# Who yields first when the whole store is too large: within a group the oldest.
GROUPS = (("metric", "bulk"), (RECORDING,), (EVENT,))
Reason = str  # "age", "class_size" or "store_size"

_UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86400}
_UNITS_BYTES = {"KiB": 1 << 10, "MiB": 1 << 20, "GiB": 1 << 30, "TiB": 1 << 40}
_RULE = re.compile(
    r"(?P<class>[a-z]+)=(?:(?P<age>\d+(?:\.\d+)?)(?P<age_unit>[smhd]))?"
    r"(?:,(?P<size>\d+(?:\.\d+)?)(?P<size_unit>KiB|MiB|GiB|TiB))?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassLimit:
    """The bounds of one class; None is none."""

    age_s: float | None = None
    size_bytes: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Retention:
    """The bounds of the store: how old data, and events, may get, and how much all of it may be; `classes` beside."""

    age_s: float
    size_bytes: int
    event_age_s: float | None = None  # of events, recordings and the record of losses; None: as everything else
    classes: Mapping[str, ClassLimit] = field(default_factory=dict)

    def limit(self, name: str) -> ClassLimit:
        """The bounds of a class."""
        own = self.classes.get(name, ClassLimit())
        longest = name in (EVENT, RECORDING) and self.event_age_s is not None
        age_s = own.age_s if own.age_s is not None else self.event_age_s if longest else self.age_s
        return ClassLimit(age_s=age_s, size_bytes=own.size_bytes)

    def before_ns(self, name: str, *, now_ns: int) -> int:
        """What of a class was stored before this time is too old."""
        age_s = self.limit(name).age_s
        return max(0, now_ns - round((age_s if age_s is not None else self.age_s) * 1e9))

    def gaps_before_ns(self, *, now_ns: int) -> int:
        """The record of losses from before this time goes: it is kept as long as anything that could show the loss."""
        return min(self.before_ns(name, now_ns=now_ns) for name in ("metric", "bulk", EVENT))


class Bounds(Protocol):
    """What a gateway's settings say of it; days, bytes, and the rules `CLASS=AGE,SIZE`."""

    @property
    def retention_days(self) -> float:
        """Of series, bulk messages and all else."""

    @property
    def event_retention_days(self) -> float:
        """Of events, recordings and the record of losses."""

    @property
    def retention_bytes(self) -> int:
        """Of all together."""

    @property
    def retention_rules(self) -> tuple[str, ...]:
        """Of single classes."""


@dataclass(frozen=True, slots=True)
class Holding:
    """An item that can be deleted by itself; `table` and `key` name its row, `object` its object."""

    kind: str
    table: str
    key: int | str
    stored_ns: int
    size_bytes: int
    object: str = ""


@dataclass(frozen=True, slots=True)
class PlannedDeletion:
    """A holding that is to be deleted, and why."""

    holding: Holding
    why: Reason


@dataclass(frozen=True, slots=True)
class Usage:
    """What there is: bytes of all, and of the classes that have a bound of their own."""

    total_bytes: int
    classes: Mapping[str, int] = field(default_factory=dict)


def class_limits(rules: Sequence[str]) -> dict[str, ClassLimit]:
    """The rules `CLASS=AGE,SIZE` as a table.

    Raises:
        ConfigError: one of them is none; the message says how they look.
    """
    found: dict[str, ClassLimit] = {}
    for rule in rules:
        match = _RULE.fullmatch(rule)
        if match is None or match["class"] not in CLASSES or not (match["age"] or match["size"]):
            raise ConfigError(
                f"--retention {rule}: CLASS=AGE,SIZE like bulk=3d,20GiB, metric=30d or event=,1GiB\n"
                f"Classes are {', '.join(CLASSES)}; units s, m, h, d and KiB, MiB, GiB, TiB."
            )
        age_s = float(match["age"]) * _UNITS_S[match["age_unit"]] if match["age"] else None
        size_bytes = round(float(match["size"]) * _UNITS_BYTES[match["size_unit"]]) if match["size"] else None
        if age_s == 0 or match["class"] in found:
            raise ConfigError(f"--retention {rule}: an age is more than 0, and a class is named once")
        found[match["class"]] = ClassLimit(age_s=age_s, size_bytes=size_bytes)
    return found


def retention_of(settings: Bounds) -> Retention:
    """The retention that a gateway's settings ask for."""
    return Retention(
        age_s=settings.retention_days * _UNITS_S["d"],
        event_age_s=settings.event_retention_days * _UNITS_S["d"],
        size_bytes=settings.retention_bytes,
        classes=class_limits(settings.retention_rules),
    )


def plan(
    retention: Retention, usage: Usage, oldest: Callable[[str], Iterator[Holding]], *, now_ns: int
) -> Iterator[PlannedDeletion]:
    """What is to go, one after the other; `oldest` gives a class's holdings by the time they were stored.

    It is read only as far as something goes, so whoever stops early has read little.
    """
    queues = {name: _Queue(oldest(name), usage.classes.get(name, 0)) for name in CLASSES}
    freed = 0
    for name, queue in queues.items():
        for holding in queue.before(retention.before_ns(name, now_ns=now_ns)):
            freed += holding.size_bytes
            yield PlannedDeletion(holding, "age")
        most_bytes = retention.limit(name).size_bytes
        for holding in queue.over(most_bytes) if most_bytes is not None else ():
            freed += holding.size_bytes
            yield PlannedDeletion(holding, "class_size")
    excess = usage.total_bytes - freed - retention.size_bytes
    rest = (heapq.merge(*(queues[name].rest() for name in group), key=lambda item: item.stored_ns) for group in GROUPS)
    for holding in chain.from_iterable(rest):
        if excess <= 0:
            return
        excess -= holding.size_bytes
        yield PlannedDeletion(holding, "store_size")


class _Queue:
    """A class's holdings, oldest first, and how many bytes are left of it."""

    def __init__(self, holdings: Iterator[Holding], left_bytes: int) -> None:
        self._holdings = holdings
        self._left_bytes = left_bytes
        self._next: Holding | None = None

    def before(self, before_ns: int) -> Iterator[Holding]:
        """Those that were stored before."""
        while (holding := self._peek()) is not None and holding.stored_ns < before_ns:
            yield self._taken(holding)

    def over(self, most_bytes: int) -> Iterator[Holding]:
        """As many as are too much."""
        while self._left_bytes > most_bytes and (holding := self._peek()) is not None:
            yield self._taken(holding)

    def rest(self) -> Iterator[Holding]:
        """All that are left."""
        while (holding := self._peek()) is not None:
            yield self._taken(holding)

    def _taken(self, holding: Holding) -> Holding:
        self._next = None
        self._left_bytes -= holding.size_bytes
        return holding

    def _peek(self) -> Holding | None:
        if self._next is None:
            self._next = next(self._holdings, None)
        return self._next
