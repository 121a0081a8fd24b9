"""Calls of functions in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, fields

from gateway.domain.automation.invocation import InvocationFilter, Recorded
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = ["add_invocations", "list_invocations", "newest_invocations", "purge_invocations"]

_NAMES = tuple(item.name for item in fields(Recorded))
_COLUMNS = ", ".join({"id": "invocation", "request_id": "request"}.get(name, name) for name in _NAMES)
_PAGE = 512


def add_invocations(engine: StoreEngine, calls: Sequence[Recorded]) -> None:
    """Keep some; of one id the first."""
    sql = f"INSERT INTO invocations ({_COLUMNS}) VALUES ({placeholders(len(_NAMES))}) ON CONFLICT DO NOTHING"
    engine.many(sql, [tuple(map(_text, astuple(call))) for call in calls])


def list_invocations(engine: StoreEngine, wanted: InvocationFilter, *, limit: int, before: str = "") -> list[Recorded]:
    """The newest calls that somebody wants and may see, the newest first; `before` is the id after which to go on."""
    last, found = before, list[Recorded]()
    while True:
        conditions, values = _where(wanted, last)
        sql = f"SELECT {_COLUMNS} FROM invocations WHERE {conditions} ORDER BY invocation DESC LIMIT ?"
        rows = engine.fetch(sql, *values, _PAGE)
        for row in rows:
            call = _recorded(row)
            if wanted.sees is None or wanted.sees(call.robot):
                found.append(call)
            if len(found) == limit:
                return found
        if len(rows) < _PAGE:
            return found
        last = rows[-1][0]


def newest_invocations(engine: StoreEngine, *, since_ns: int, limit: int) -> list[Recorded]:
    """The newest calls of all functions that began since, the oldest first and without their logs."""
    columns = _COLUMNS.replace(", log", ", ''")
    sql = f"SELECT {columns} FROM invocations WHERE began_ns >= ? ORDER BY invocation DESC LIMIT ?"
    return [_recorded(row) for row in reversed(engine.fetch(sql, since_ns, limit))]


def purge_invocations(engine: StoreEngine, *, before: str, most: int, limit: int = 1000) -> int:
    """Delete the oldest: those whose id is before one, and of more than `most`; how many went."""
    count = int(engine.fetch("SELECT count(*) FROM invocations")[0][0])
    going = "SELECT invocation FROM invocations ORDER BY invocation LIMIT ?"
    over = engine.fetch(going, min(limit, max(0, count - most)))
    old = engine.fetch(
        "SELECT invocation FROM invocations WHERE invocation < ? ORDER BY invocation LIMIT ?", before, limit
    )
    last = max((row[0] for row in (*over, *old)), default="")
    return engine.execute("DELETE FROM invocations WHERE invocation <= ?", last) if last else 0


def _where(wanted: InvocationFilter, before: str) -> tuple[str, list[str]]:
    named = {
        "function": wanted.function,
        "status": wanted.status,
        "version": wanted.version,
        "kind": wanted.kind,
        "robot": wanted.robot,
    }
    some = {name: value for name, value in named.items() if value}
    conditions = [f"{name} = ?" for name in some] + ["invocation < ?"] * bool(before)
    return " AND ".join(conditions) or "1 = 1", [*some.values(), *[before] * bool(before)]


def _recorded(row: Row) -> Recorded:
    return Recorded(**dict(zip(_NAMES, row, strict=True)))


def _text(value: object) -> object:
    """PostgreSQL knows no NUL."""
    return value.replace("\0", "\ufffd") if isinstance(value, str) else value
