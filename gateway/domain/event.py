"""Something that happened in the fleet, as it is kept and told: what, where, when, and which of them somebody wants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatchcase

__all__ = ["EVERYTHING", "Event", "EventFilter", "EventPage"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event; `seq` is its place in the journal: store-wide, without holes, and the cursor after which to go on.

    `kind` is a row of gateway/events/kinds.py, `robot` is "" for what is about no single robot, `at_ns` is the wall
    clock of the gateway that saw it, `data` is a JSON object as text.
    """

    seq: int
    kind: str
    robot: str
    at_ns: int
    gateway: str
    data: str = "{}"


@dataclass(frozen=True, slots=True, kw_only=True)
class EventFilter:
    """Which events somebody wants, and which they may have.

    `kinds` are globs such as `robot.*`, `robots` are ids; none of either is all. `sees` says which robots are in scope
    (None: all); an event about no robot is only for whoever `sees_fleet`.
    """

    kinds: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    sees: Callable[[str], bool] | None = None
    sees_fleet: bool = True

    def matches(self, event: Event) -> bool:
        """Whether the event is one of those."""
        if self.kinds and not any(fnmatchcase(event.kind, kind) for kind in self.kinds):
            return False
        if self.robots and event.robot not in self.robots:
            return False
        if not event.robot:
            return self.sees_fleet
        return self.sees is None or self.sees(event.robot)


EVERYTHING = EventFilter()


@dataclass(frozen=True, slots=True, kw_only=True)
class EventPage:
    """Some events, the cursor that goes on behind them, and how many before them are not kept any more.

    `next` is 0 where a page backwards has nothing behind it.
    """

    events: tuple[Event, ...] = ()
    next: int = 0
    lost: int = 0
