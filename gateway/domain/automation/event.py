"""An event of the fleet's journal: what, where and when; and filters over events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["EVERYTHING", "Event", "EventFilter", "EventPage", "like"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event; `seq` is its place in the journal: store-wide, without holes, and the cursor after which to go on.

    `kind` is a row of gateway/automation/events/kinds.py, `robot` is "" for what is about no single robot, `at_ns`
    is the wall clock of the gateway that saw it, `data` is a JSON object as text.
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
        if self.kinds and not any(like(event.kind, kind) for kind in self.kinds):
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


def like(text: str, pattern: str) -> bool:
    """Whether a text is like a pattern: `*` is any characters, `?` is one.

    No regular expression: clients choose the patterns, and compiling sixty long ones takes a good part of a second.
    """
    at = place = 0
    star, tried = -1, 0  # the last `*`, and up to where it reaches by now
    while at < len(text):
        if place < len(pattern) and pattern[place] == "*":
            star, tried = place, at
            place += 1
        elif place < len(pattern) and pattern[place] in ("?", text[at]):
            at, place = at + 1, place + 1
        elif star >= 0:
            tried += 1
            at, place = tried, star + 1
        else:
            return False
    return not pattern[place:].strip("*")
