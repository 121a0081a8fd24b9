"""Replays in the database: what was asked, and how far each is. Every function runs inside a transaction of the
caller's.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import orjson

from gateway.domain.automation.gateway_event import Replay, Span
from gateway.store.automation.gateway_events import Cursor
from gateway.store.engine import Row, StoreEngine

__all__ = ["add_replay", "advance_replay", "end_replay", "read_replay", "read_replays"]

_COLUMNS = "replay, span, spec, made_ns, read, put, ended_ns, code, at_ns, place, number"


def add_replay(engine: StoreEngine, replay: Replay, *, now_ns: int) -> Replay:
    """Begin a replay, or find the one of that id, as it was asked first."""
    span = {**dataclasses.asdict(replay.span), "robots": _listed(replay.span.robots)}
    start = Cursor(replay.span.from_ns)
    engine.execute(
        f"INSERT INTO replays ({_COLUMNS}) VALUES (?, ?, ?, ?, 0, 0, 0, '', ?, ?, ?) ON CONFLICT (replay) DO NOTHING",
        replay.id,
        orjson.dumps(span).decode(),
        orjson.dumps(dict(replay.spec)).decode(),
        now_ns,
        *start,
    )
    found = read_replay(engine, replay.id)
    return found[0] if found is not None else replay


def advance_replay(engine: StoreEngine, replay_id: str, cursor: Cursor, *, read: int, put: int) -> bool:
    """Note how far it is, and how many more were read and put; whether it still goes on."""
    sql = (
        "UPDATE replays SET at_ns = ?, place = ?, number = ?, read = read + ?, put = put + ?"
        " WHERE replay = ? AND ended_ns = 0"
    )
    return bool(engine.execute(sql, *cursor, read, put, replay_id))


def end_replay(engine: StoreEngine, replay_id: str, *, now_ns: int, code: str = "") -> bool:
    """It is over; False where it was."""
    sql = "UPDATE replays SET ended_ns = ?, code = ? WHERE replay = ? AND ended_ns = 0"
    return bool(engine.execute(sql, now_ns, code, replay_id))


def read_replay(engine: StoreEngine, replay_id: str) -> tuple[Replay, Cursor] | None:
    """A replay, and the event behind which it goes on."""
    rows = engine.fetch(f"SELECT {_COLUMNS} FROM replays WHERE replay = ?", replay_id)
    return (_replay(rows[0]), Cursor(rows[0][8], rows[0][9], rows[0][10])) if rows else None


def read_replays(engine: StoreEngine, *, limit: int) -> list[Replay]:
    """Replays, those that go on first, then the newest."""
    sql = f"SELECT {_COLUMNS} FROM replays ORDER BY (CASE WHEN ended_ns = 0 THEN 0 ELSE 1 END), made_ns DESC LIMIT ?"
    return [_replay(row) for row in engine.fetch(sql, limit)]


def _listed(robots: frozenset[str] | None) -> Sequence[str] | None:
    return sorted(robots) if robots is not None else None


def _replay(row: Row) -> Replay:
    span: dict[str, Any] = orjson.loads(row[1])
    robots = span["robots"]
    return Replay(
        id=row[0],
        span=Span(
            from_ns=span["from_ns"],
            to_ns=span["to_ns"],
            types=tuple(span["types"]),
            robots=frozenset(robots) if robots is not None else None,
        ),
        spec=orjson.loads(row[2]),
        made_ns=row[3],
        read=row[4],
        put=row[5],
        ended_ns=row[6],
        code=row[7],
    )
