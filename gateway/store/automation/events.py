"""The journal of events in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gateway.domain.automation.event import Event
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = ["add_events", "event_bounds", "newest_events", "purge_events", "read_events"]

_SELECT = "SELECT event, kind, robot, at_ns, gateway, data FROM events"


def add_events(engine: StoreEngine, events: Sequence[Event]) -> int:
    """Append events under the next numbers, whatever `seq` they have; the newest number."""
    engine.execute("UPDATE event_head SET number = number + ? WHERE id = 1", len(events))
    last = int(engine.fetch("SELECT number FROM event_head WHERE id = 1")[0][0])
    first = last - len(events) + 1
    engine.many(
        "INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)",
        [
            (seq, item.kind, item.robot, item.at_ns, item.gateway, item.data)
            for seq, item in enumerate(events, start=first)
        ],
    )
    return last


def event_bounds(engine: StoreEngine) -> tuple[int, int]:
    """The oldest number that is kept (one past the newest where none is), and the newest that was given."""
    last = int(engine.fetch("SELECT number FROM event_head WHERE id = 1")[0][0])
    first = engine.fetch("SELECT min(event) FROM events")[0][0]
    return (int(first) if first is not None else last + 1), last


def read_events(engine: StoreEngine, *, after: int, robots: Sequence[str] = (), limit: int) -> list[Event]:
    """Events behind a number, the oldest first."""
    conditions, values = _about(robots)
    sql = f"{_SELECT} WHERE event > ?{conditions} ORDER BY event LIMIT ?"
    return [_event(row) for row in engine.fetch(sql, after, *values, limit)]


def newest_events(engine: StoreEngine, *, before: int, robots: Sequence[str] = (), limit: int) -> list[Event]:
    """Events before a number, the newest first."""
    conditions, values = _about(robots)
    sql = f"{_SELECT} WHERE event < ?{conditions} ORDER BY event DESC LIMIT ?"
    return [_event(row) for row in engine.fetch(sql, before, *values, limit)]


def purge_events(engine: StoreEngine, *, before_ns: int, most: int, limit: int = 1000) -> int:
    """Delete the oldest: those from before a time, and of more than `most`; how many went.

    From the oldest on without a hole, so that what is gone is always a number of events before the first.
    """
    first, last = event_bounds(engine)
    until = max(first, last - most + 1)
    row = engine.fetch("SELECT min(event) FROM events WHERE at_ns >= ?", before_ns)[0][0]
    until = min(max(until, int(row) if row is not None else last + 1), first + limit)
    return engine.execute("DELETE FROM events WHERE event < ?", until) if until > first else 0


def _about(robots: Sequence[str]) -> tuple[str, list[Any]]:
    return (f" AND robot IN ({placeholders(len(robots))})", list(robots)) if robots else ("", [])


def _event(row: Row) -> Event:
    return Event(seq=row[0], kind=row[1], robot=row[2], at_ns=row[3], gateway=row[4], data=row[5])
