"""Which gateway judges which robot, and what its detectors had learned. Inside a transaction of the caller's.

A gateway's right to a robot is the row's owner, and lasts as long as the gateway is believed to live (`gateways`). It
has a number, the fence, which grows whenever the owner changes: what a former owner writes afterwards does not count.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import orjson

from gateway.store.engine import StoreEngine, placeholders, slices

__all__ = [
    "Marks",
    "Saved",
    "drop_states",
    "free_all",
    "held_by",
    "know_robots",
    "orphans",
    "owner_of",
    "read_state",
    "save_states",
    "take_states",
]

Marks = dict[tuple[int, int], int]  # by stream and epoch: the last number that was judged


@dataclass(frozen=True, slots=True, kw_only=True)
class Saved:
    """A robot's detectors as they were at a moment; version 0: nothing was saved yet.

    `newest_ns` is the newest stamp that they had seen, by the robot's clock.
    """

    robot: str
    fence: int
    version: int
    saved_ns: int
    newest_ns: int
    marks: Marks
    state: bytes


def know_robots(engine: StoreEngine, robots: Collection[str]) -> None:
    """Have a row for each of these."""
    rows = [(robot, b"") for robot in sorted(robots)]
    engine.many("INSERT INTO watch_states VALUES (?, '', 0, 0, 0, 0, '[]', ?) ON CONFLICT (robot) DO NOTHING", rows)


def take_states(
    engine: StoreEngine, robots: Collection[str], gateway: str, *, now_ns: int, force: bool = False
) -> dict[str, int]:
    """Take robots that nobody has, or whose gateway is dead; with `force` from whoever has them. The fence of each.

    Not in the result: those of gateways that live.
    """
    know_robots(engine, robots)
    free = "owner = '' OR NOT EXISTS (SELECT 1 FROM gateways g WHERE g.gateway = owner AND g.until_ns > ?)"
    update = (
        f"UPDATE watch_states SET owner = ?, fence = fence + 1 WHERE robot = ? AND owner <> ? AND (? = 1 OR {free})"
    )
    engine.many(update, [(gateway, robot, gateway, int(force), now_ns) for robot in sorted(robots)])
    found: dict[str, int] = {}
    for some in slices(sorted(robots)):
        query = f"SELECT robot, fence FROM watch_states WHERE owner = ? AND robot IN ({placeholders(len(some))})"
        found.update((row[0], int(row[1])) for row in engine.fetch(query, gateway, *some))
    return found


def free_all(engine: StoreEngine, gateway: str) -> None:
    """A gateway begins: what it had in a former life is anybody's."""
    engine.execute("UPDATE watch_states SET owner = '', fence = fence + 1 WHERE owner = ?", gateway)


def held_by(engine: StoreEngine, gateway: str) -> dict[str, int]:
    """The fence of each robot that a gateway has."""
    rows = engine.fetch("SELECT robot, fence FROM watch_states WHERE owner = ?", gateway)
    return {row[0]: int(row[1]) for row in rows}


def owner_of(engine: StoreEngine, robot: str) -> str:
    """The gateway that judges a robot, or did before it died; "": none."""
    rows = engine.fetch("SELECT owner FROM watch_states WHERE robot = ?", robot)
    return str(rows[0][0]) if rows else ""


def orphans(engine: StoreEngine, *, now_ns: int) -> list[str]:
    """The robots that nobody has who lives."""
    query = (
        "SELECT robot FROM watch_states w WHERE NOT EXISTS"
        " (SELECT 1 FROM gateways g WHERE g.gateway = w.owner AND g.until_ns > ?) ORDER BY robot"
    )
    return [row[0] for row in engine.fetch(query, now_ns)]


def read_state(engine: StoreEngine, robot: str) -> Saved | None:
    """What was saved of a robot last, and by which fence it is held now."""
    query = "SELECT fence, version, saved_ns, newest_ns, marks, state FROM watch_states WHERE robot = ?"
    rows = engine.fetch(query, robot)
    if not rows:
        return None
    fence, version, saved_ns, newest_ns, marks, state = rows[0]
    watermarks = {(stream, epoch): seq for stream, epoch, seq in orjson.loads(marks)}
    return Saved(
        robot=robot,
        fence=fence,
        version=version,
        saved_ns=saved_ns,
        newest_ns=newest_ns,
        marks=watermarks,
        state=bytes(state),
    )


def save_states(engine: StoreEngine, gateway: str, states: Sequence[Saved], *, free: bool = False) -> set[str]:
    """Keep what robots' detectors learned, with `free` also let them go. The robots that were still this one's."""
    mine: dict[str, int] = {}
    for some in slices(sorted(state.robot for state in states)):
        query = f"SELECT robot, fence FROM watch_states WHERE owner = ? AND robot IN ({placeholders(len(some))})"
        found = engine.fetch(f"{query} ORDER BY robot{engine.for_update}", gateway, *some)
        mine.update((row[0], int(row[1])) for row in found)
    kept = [state for state in states if mine.get(state.robot) == state.fence]
    engine.many(
        "UPDATE watch_states SET owner = ?, version = ?, saved_ns = ?, newest_ns = ?, marks = ?, state = ?"
        " WHERE robot = ?",
        [_row(state, "" if free else gateway) for state in sorted(kept, key=lambda state: state.robot)],
    )
    return {state.robot for state in kept}


def drop_states(engine: StoreEngine, robots: Collection[str]) -> None:
    """Nobody expects these robots any more: what was learned of them goes."""
    engine.many("DELETE FROM watch_states WHERE robot = ?", [(robot,) for robot in sorted(robots)])


def _row(state: Saved, owner: str) -> tuple[str | int | bytes, ...]:
    marks = orjson.dumps([(*key, seq) for key, seq in state.marks.items()]).decode()
    return owner, state.version, state.saved_ns, state.newest_ns, marks, state.state, state.robot
