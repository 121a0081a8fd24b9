"""What happened, kept so that it can be looked at and delivered again: what came from outside or by a rule's own making
in a table of its own, the rest in the journal of events. Every function runs inside a transaction of the caller's.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import orjson

from gateway.domain.automation.event import Event
from gateway.domain.automation.gateway_event import JOURNAL, GatewayEvent, Span, from_journal
from gateway.store.automation.queue_totals import GATEWAY_EVENTS, count
from gateway.store.engine import StoreEngine, placeholders, slices
from gateway.store.schema import ROW_BYTES
from metaros.errors import TooLargeError
from metaros.limits import LIMITS, Limits

__all__ = ["Cursor", "add_gateway_events", "find_gateway_event", "read_gateway_events"]

_EVENTS, _OWN = 0, 1  # places
_COLUMNS = "source, id, type, robot, at_ns, stored_ns, size_bytes, data"
_SELECT = "SELECT at_ns, happening, source, id, type, robot, data FROM happenings"
_SELECT_EVENT = "SELECT at_ns, event, kind, robot, gateway, data FROM events"


class Cursor(NamedTuple):
    """An event's place among all, by time."""

    at_ns: int
    place: int = _EVENTS
    number: int = -1


def add_gateway_events(
    engine: StoreEngine, gateway_events: Sequence[GatewayEvent], *, gateway: str, now_ns: int, limits: Limits = LIMITS
) -> list[GatewayEvent]:
    """Keep events; those that are new by source and id, each once.

    Raises:
        TooLargeError: the data of one is over its limit; none is kept.
    """
    unique = {(one.source, one.id): one for one in reversed(gateway_events)}
    # Gateways that keep the same at once wait for each other, in one order.
    rows = {key: _row(unique[key], now_ns, limits) for key in sorted(unique)}
    new: set[tuple[str, str]] = set()
    for some in slices(list(rows.values())):
        values = ", ".join(["(?, ?, ?, ?, ?, ?, ?, ?)"] * len(some))
        sql = f"INSERT INTO happenings ({_COLUMNS}) VALUES {values} ON CONFLICT DO NOTHING RETURNING source, id"
        new.update((row[0], row[1]) for row in engine.fetch(sql, *(value for row in some for value in row)))
    count(engine, gateway, GATEWAY_EVENTS, len(new), sum(rows[key][6] for key in new))
    return [one for key, one in reversed(unique.items()) if key in new]


def read_gateway_events(
    engine: StoreEngine, span: Span, *, after: Cursor | None = None, limit: int
) -> list[tuple[Cursor, GatewayEvent]]:
    """Events of a span behind a cursor, by their time: those of the journal and the others together."""
    start = after if after is not None else Cursor(span.from_ns)
    found = heapq.merge(_events(engine, span, start, limit), _own(engine, span, start, limit), key=lambda item: item[0])
    return [item for item, _ in zip(found, range(limit), strict=False)]


def find_gateway_event(engine: StoreEngine, source: str, event_id: str) -> GatewayEvent | None:
    """One of them; None where it is not kept."""
    if source == JOURNAL and event_id[:2] == "e-" and event_id[2:].isdecimal() and len(event_id) < 20:
        rows = engine.fetch(f"{_SELECT_EVENT} WHERE event = ?", int(event_id[2:]))
        return _of_event(rows[0]) if rows else None
    rows = engine.fetch(f"{_SELECT} WHERE source = ? AND id = ?", source, event_id)
    return _of_own(rows[0]) if rows else None


def _row(one: GatewayEvent, now_ns: int, limits: Limits) -> tuple[Any, ...]:
    data = orjson.dumps(dict(one.data)).decode()
    size_bytes = len(data.encode())
    if size_bytes > limits.happening_bytes:
        raise TooLargeError(
            f"the data of event {one.id[:64]} has {size_bytes} B, and {limits.happening_bytes} B may: happening_bytes"
        )
    return (one.source, one.id, one.type, one.robot, one.at_ns, now_ns, size_bytes + ROW_BYTES, data)


def _events(engine: StoreEngine, span: Span, start: Cursor, limit: int) -> Iterable[tuple[Cursor, GatewayEvent]]:
    prefix = f"{JOURNAL}."
    kinds = [name.removeprefix(prefix) for name in span.types if name.startswith(prefix)]
    if span.types and not kinds:
        return []
    conditions, values = _conditions(span, "kind", kinds)
    number = start.number if start.place == _EVENTS else 1 << 62
    sql = f"{_SELECT_EVENT} WHERE (at_ns, event) > (?, ?) AND at_ns < ?{conditions} ORDER BY at_ns, event LIMIT ?"
    rows = engine.fetch(sql, start.at_ns, number, span.to_ns, *values, limit)
    return [(Cursor(row[0], _EVENTS, row[1]), _of_event(row)) for row in rows]


def _own(engine: StoreEngine, span: Span, start: Cursor, limit: int) -> Iterable[tuple[Cursor, GatewayEvent]]:
    conditions, values = _conditions(span, "type", span.types)
    number = start.number if start.place == _OWN else -1
    sql = f"{_SELECT} WHERE (at_ns, happening) > (?, ?) AND at_ns < ?{conditions} ORDER BY at_ns, happening LIMIT ?"
    rows = engine.fetch(sql, start.at_ns, number, span.to_ns, *values, limit)
    return [(Cursor(row[0], _OWN, row[1]), _of_own(row)) for row in rows]


def _conditions(span: Span, column: str, types: Sequence[str]) -> tuple[str, list[Any]]:
    conditions, values = "", []
    for name, some in ((column, types or None), ("robot", span.robots)):
        if some is not None:
            conditions += f" AND {name} IN ({placeholders(len(some))})" if some else " AND 1 = 0"
            values += sorted(some)
    return conditions, values


def _of_event(row: Any) -> GatewayEvent:
    return from_journal(Event(seq=row[1], kind=row[2], robot=row[3], at_ns=row[0], gateway=row[4], data=row[5]))


def _of_own(row: Any) -> GatewayEvent:
    return GatewayEvent(id=row[3], type=row[4], source=row[2], at_ns=row[0], robot=row[5], data=orjson.loads(row[6]))
