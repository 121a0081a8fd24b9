"""Recordings in the database: what was asked, how far each is, and which object holds its file.

Every function runs inside a transaction of the caller's. A change names the states from which it may happen and says
whether it did: two gateways on one database may both be at work on one recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import orjson

from gateway.domain.fleet.recording import UNFINISHED, Recording
from gateway.errors import TooManyError, UnknownRobotError
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = [
    "add_recording",
    "change_recording",
    "count_unfinished",
    "get_recording",
    "list_recordings",
    "remove_recording",
    "unfinished_recordings",
]

_COLUMNS = (
    "recording, robots.id, state, from_ns, to_ns, topics, requested_ns, live_ns, recordings.first_ns,"
    " recordings.last_ns, size_bytes, received_bytes, messages, sha256, code, message, object"
)
_SELECT = f"SELECT {_COLUMNS} FROM recordings JOIN robots ON robots.robot = recordings.robot"
_CHANGEABLE = frozenset(
    {
        "state",
        "live_ns",
        "first_ns",
        "last_ns",
        "size_bytes",
        "received_bytes",
        "messages",
        "sha256",
        "code",
        "message",
        "object",
    }
)


def add_recording(engine: StoreEngine, recording: Recording, *, unfinished: int) -> None:
    """Store a request.

    Raises:
        UnknownRobotError: no robot of that id ever connected.
        TooManyError: the robot has `unfinished` of them already.
    """
    if count_unfinished(engine, recording.robot) >= unfinished:
        raise TooManyError(f"robot {recording.robot} has {unfinished} unfinished recordings already")
    rows = engine.fetch("SELECT robot FROM robots WHERE id = ?", recording.robot)
    if not rows:
        raise UnknownRobotError(f"no robot {recording.robot!r} has ever connected")
    engine.execute(
        "INSERT INTO recordings (recording, robot, state, from_ns, to_ns, topics, requested_ns, live_ns, first_ns,"
        f" last_ns, size_bytes, received_bytes, messages, sha256, code, message) VALUES ({placeholders(16)})",
        recording.id,
        rows[0][0],
        recording.state,
        recording.from_ns,
        recording.to_ns,
        orjson.dumps(recording.topics).decode(),
        recording.requested_ns,
        recording.live_ns,
        recording.first_ns,
        recording.last_ns,
        recording.size_bytes,
        recording.received_bytes,
        recording.messages,
        recording.sha256,
        recording.code,
        recording.message,
    )


def count_unfinished(engine: StoreEngine, robot_id: str) -> int:
    """How many of the robot's recordings are not at their end."""
    sql = (
        "SELECT count(*) FROM recordings JOIN robots ON robots.robot = recordings.robot"
        f" WHERE robots.id = ? AND state IN ({placeholders(len(UNFINISHED))})"
    )
    return int(engine.fetch(sql, robot_id, *UNFINISHED)[0][0])


def get_recording(engine: StoreEngine, recording_id: str) -> Recording | None:
    """One recording."""
    rows = engine.fetch(f"{_SELECT} WHERE recording = ?", recording_id)
    return _recording(rows[0]) if rows else None


def list_recordings(
    engine: StoreEngine, *, robot_id: str | None = None, limit: int, before: str | None = None
) -> list[Recording]:
    """The newest recordings, newest first; `before` is the id after which to go on."""
    conditions = ["1 = 1"] + ["robots.id = ?"] * (robot_id is not None) + ["recording < ?"] * (before is not None)
    values = [value for value in (robot_id, before) if value is not None]
    sql = f"{_SELECT} WHERE {' AND '.join(conditions)} ORDER BY recording DESC LIMIT ?"
    return [_recording(row) for row in engine.fetch(sql, *values, limit)]


def unfinished_recordings(engine: StoreEngine, *, robots: Sequence[str] | None = None) -> list[Recording]:
    """The recordings that are not at their end, oldest first; of these robots, or of all."""
    if robots is not None and not robots:
        return []
    only = f" AND robots.id IN ({placeholders(len(robots))})" if robots is not None else ""
    sql = f"{_SELECT} WHERE state IN ({placeholders(len(UNFINISHED))}){only} ORDER BY recording"
    return [_recording(row) for row in engine.fetch(sql, *UNFINISHED, *(robots or ()))]


def change_recording(
    engine: StoreEngine, recording_id: str, *, within: Sequence[str] = UNFINISHED, **values: Any
) -> bool:
    """Set some columns where the state is one of `within`; False when it is not, or the recording is gone."""
    if unknown := values.keys() - _CHANGEABLE:
        raise ValueError(f"no columns to change: {sorted(unknown)}")
    settings = ", ".join(f"{name} = ?" for name in values)
    sql = f"UPDATE recordings SET {settings} WHERE recording = ? AND state IN ({placeholders(len(within))})"
    return bool(engine.execute(sql, *values.values(), recording_id, *within))


def remove_recording(engine: StoreEngine, recording_id: str) -> Recording | None:
    """Delete the row; what it was, whose object the caller dooms in the same transaction. None: there is none."""
    engine.fetch("SELECT 1 FROM recordings WHERE recording = ?" + engine.for_update, recording_id)
    found = get_recording(engine, recording_id)
    engine.execute("DELETE FROM recordings WHERE recording = ?", recording_id)
    return found


def _recording(row: Row) -> Recording:
    return Recording(
        id=row[0],
        robot=row[1],
        state=row[2],
        from_ns=row[3],
        to_ns=row[4],
        topics=tuple(orjson.loads(row[5])),
        requested_ns=row[6],
        live_ns=row[7],
        first_ns=row[8],
        last_ns=row[9],
        size_bytes=row[10],
        received_bytes=row[11],
        messages=row[12],
        sha256=row[13],
        code=row[14],
        message=row[15],
        object=row[16],
    )
