"""What belongs to alerts in the database: remarks, silences, and what each route of notices was told.

Every function runs inside a transaction of the caller's.
"""

from __future__ import annotations

import orjson

from gateway.domain.alert import Remark, Silence
from gateway.errors import TooManyError
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = [
    "add_remark",
    "add_silence",
    "current_silences",
    "end_silence",
    "list_remarks",
    "read_silence",
]

_SILENCE = "silence, robots, causes, up_to, from_ns, until_ns, author, reason"


def add_remark(engine: StoreEngine, remark: Remark, *, most: int) -> Remark:
    """Keep a remark under its alert's next number; TooManyError where the alert has `most` of them."""
    rows = engine.fetch("SELECT max(number) FROM alert_remarks WHERE alert = ?", remark.alert)
    number = int(rows[0][0] or 0) + 1
    if number > most:
        raise TooManyError(f"alert {remark.alert} has {most} remarks already")
    engine.execute(
        f"INSERT INTO alert_remarks (alert, number, at_ns, author, kind, text) VALUES ({placeholders(6)})",
        remark.alert,
        number,
        remark.at_ns,
        remark.by,
        remark.kind,
        remark.text,
    )
    return Remark(
        alert=remark.alert, number=number, at_ns=remark.at_ns, by=remark.by, kind=remark.kind, text=remark.text
    )


def list_remarks(engine: StoreEngine, alert_id: str) -> list[Remark]:
    """What was said and done about an alert, the oldest first."""
    rows = engine.fetch(
        "SELECT alert, number, at_ns, author, kind, text FROM alert_remarks WHERE alert = ? ORDER BY number", alert_id
    )
    return [Remark(alert=row[0], number=row[1], at_ns=row[2], by=row[3], kind=row[4], text=row[5]) for row in rows]


def add_silence(engine: StoreEngine, silence: Silence, *, most: int, now_ns: int, kept_ns: int) -> None:
    """Keep a new silence, and forget those that ended long ago; TooManyError where `most` are not over."""
    engine.execute("DELETE FROM silences WHERE until_ns < ?", now_ns - kept_ns)
    if int(engine.fetch("SELECT count(*) FROM silences WHERE until_ns > ?", now_ns)[0][0]) >= most:
        raise TooManyError(f"{most} silences are not over: end one first")
    engine.execute(
        f"INSERT INTO silences ({_SILENCE}) VALUES ({placeholders(8)})",
        silence.id,
        orjson.dumps(silence.robots).decode(),
        orjson.dumps(silence.causes).decode(),
        silence.up_to,
        silence.from_ns,
        silence.until_ns,
        silence.by,
        silence.reason,
    )


def end_silence(engine: StoreEngine, silence_id: str, *, now_ns: int) -> None:
    """Let a silence be over now, unless it is already."""
    engine.execute("UPDATE silences SET until_ns = ? WHERE silence = ? AND until_ns > ?", now_ns, silence_id, now_ns)


def read_silence(engine: StoreEngine, silence_id: str) -> Silence | None:
    """One silence."""
    rows = engine.fetch(f"SELECT {_SILENCE} FROM silences WHERE silence = ?", silence_id)
    return _silence(rows[0]) if rows else None


def current_silences(engine: StoreEngine, *, now_ns: int) -> list[Silence]:
    """Those that are not over, the one that ends first is first."""
    rows = engine.fetch(f"SELECT {_SILENCE} FROM silences WHERE until_ns > ? ORDER BY until_ns, silence", now_ns)
    return [_silence(row) for row in rows]


def _silence(row: Row) -> Silence:
    robots, causes = orjson.loads(row[1]), orjson.loads(row[2])
    return Silence(
        id=row[0],
        robots=tuple(robots),
        causes=tuple(causes),
        up_to=row[3],
        from_ns=row[4],
        until_ns=row[5],
        by=row[6],
        reason=row[7],
    )
