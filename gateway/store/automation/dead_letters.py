"""What could not be delivered, and is kept for people: look, try again, or drop. Every function runs inside a
transaction of the caller's.
"""

from __future__ import annotations

from typing import Any

from gateway.domain.automation.delivery import DeadFilter, Delivery, Share
from gateway.store.automation.delivery_rows import COLUMNS, age_ns, delivery_of, skip_locked
from gateway.store.automation.queue_totals import DEAD_ROWS, LIVE, check_room, count, totals
from gateway.store.engine import StoreEngine, placeholders
from metaros.limits import LIMITS, Limits

__all__ = ["dead_page", "drop_dead", "redrive"]

_BARE = COLUMNS.replace("payload", "coalesce(substr(payload, 1, 0), payload)")  # a page shows no payloads


def dead_page(
    engine: StoreEngine, wanted: DeadFilter, *, before: tuple[int, str] | None = None, limit: int
) -> list[Delivery]:
    """Dead letters without their payloads, the newest first; `before` is the `ended_ns` and id of the last one seen."""
    conditions, values = _of(wanted)
    if before is not None:
        conditions += " AND (ended_ns, delivery) < (?, ?)"
        values += before
    sql = f"SELECT {_BARE} FROM deliveries WHERE {conditions} ORDER BY ended_ns DESC, delivery DESC LIMIT ?"
    return [delivery_of(row) for row in engine.fetch(sql, *values, limit)]


def redrive(
    engine: StoreEngine, wanted: DeadFilter, *, gateway: str, now_ns: int, limit: int, limits: Limits = LIMITS
) -> list[tuple[str, str]]:
    """Deliver the oldest of them again, as who they are: their attempts begin anew, their age too. Kinds and targets.

    Raises:
        QueueFullError: there is no room for them; nothing was changed.
    """
    rows = _oldest(engine, wanted, limit)
    size_bytes = sum(row[3] for row in rows)
    check_room(totals(engine).live, Share(len(rows), size_bytes), limits)
    engine.many(
        "UPDATE deliveries SET state = 'waiting', due_ns = ?, expires_ns = ?, ended_ns = 0, attempts = 0, losses = 0,"
        " redrives = redrives + 1 WHERE delivery = ?",
        [(now_ns + place, now_ns + age_ns(row[4], limits), row[0]) for place, row in enumerate(rows, -len(rows))],
    )
    _moved(engine, gateway, len(rows), size_bytes, back=True)
    return [(row[1], row[2]) for row in rows]


def drop_dead(engine: StoreEngine, wanted: DeadFilter, *, gateway: str, limit: int) -> int:
    """Delete the oldest of them for good; how many."""
    rows = _oldest(engine, wanted, limit)
    engine.many("DELETE FROM deliveries WHERE delivery = ?", [(row[0],) for row in rows])
    _moved(engine, gateway, len(rows), sum(row[3] for row in rows), back=False)
    return len(rows)


def _oldest(engine: StoreEngine, wanted: DeadFilter, limit: int) -> list[Any]:
    conditions, values = _of(wanted)
    sql = (
        f"SELECT delivery, kind, target, size_bytes, policy FROM deliveries WHERE {conditions}"
        f" ORDER BY ended_ns, delivery LIMIT ?{skip_locked(engine)}"
    )
    return list(engine.fetch(sql, *values, limit))


def _moved(engine: StoreEngine, gateway: str, rows: int, size_bytes: int, *, back: bool) -> None:
    count(engine, gateway, DEAD_ROWS, -rows, -size_bytes)
    if back:
        count(engine, gateway, LIVE, rows, size_bytes)


def _of(wanted: DeadFilter) -> tuple[str, list[Any]]:
    conditions = "state = 'dead' AND ended_ns >= ? AND ended_ns < ?"
    values: list[Any] = [wanted.from_ns, wanted.to_ns]
    for column, value in (("kind", wanted.kind), ("target", wanted.target), ("code", wanted.code)):
        if value:
            conditions += f" AND {column} = ?"
            values.append(value)
    for column, some in (("delivery", wanted.ids or None), ("robot", wanted.robots)):
        if some is not None:
            conditions += f" AND {column} IN ({placeholders(len(some))})" if some else " AND 1 = 0"
            values += sorted(some)
    return conditions, values
