"""Rollouts in the database: the plan, how far it is, and each robot's state. Inside a transaction of the caller's.

A rollout is saved only over the revision that was read: of two who change it at once, the second reads it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import orjson

from gateway.domain.fleet.rollout import OPEN, Member, Plan, Rollout
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = ["add_rollout", "list_rollouts", "open_rollouts", "read_rollout", "revision_of", "save_rollout"]

_COLUMNS = "rollout, state, reason, wave, document, created_by, created_ns, changed_ns"
_MEMBER = "robot, place, wave, state, since_ns, reason"


def add_rollout(engine: StoreEngine, rollout: Rollout) -> None:
    """Keep a new one, with all its robots."""
    engine.execute(
        f"INSERT INTO rollouts ({_COLUMNS}, revision) VALUES (?, ?, ?, ?, ?, ?, ?, ?, 1)",
        rollout.id,
        rollout.state,
        rollout.reason,
        rollout.wave,
        _document(rollout),
        rollout.created_by,
        rollout.created_ns,
        rollout.changed_ns,
    )
    engine.many(
        f"INSERT INTO rollout_robots (rollout, {_MEMBER}) VALUES ({placeholders(7)})",
        [_member_row(rollout, member) for member in rollout.members.values()],
    )


def save_rollout(engine: StoreEngine, rollout: Rollout, *, revision: int) -> bool:
    """Keep what changed; False when the rollout is not at that revision any more, and nothing was kept."""
    kept = engine.execute(
        "UPDATE rollouts SET state = ?, reason = ?, wave = ?, document = ?, changed_ns = ?, revision = revision + 1"
        " WHERE rollout = ? AND revision = ?",
        rollout.state,
        rollout.reason,
        rollout.wave,
        _document(rollout),
        rollout.changed_ns,
        rollout.id,
        revision,
    )
    if not kept:
        return False
    rows = [
        (member.wave, member.state, member.since_ns, member.reason, rollout.id, robot)
        for robot in sorted(rollout.changed)
        if (member := rollout.members.get(robot)) is not None
    ]
    update = "UPDATE rollout_robots SET wave = ?, state = ?, since_ns = ?, reason = ? WHERE rollout = ? AND robot = ?"
    if rows:
        engine.many(update, rows)
    return True


def revision_of(engine: StoreEngine, rollout_id: str) -> int:
    """How often it was saved; 0: there is none."""
    rows = engine.fetch("SELECT revision FROM rollouts WHERE rollout = ?", rollout_id)
    return int(rows[0][0]) if rows else 0


def read_rollout(engine: StoreEngine, rollout_id: str) -> tuple[Rollout, int] | None:
    """One rollout with its robots, and its revision."""
    rows = engine.fetch(f"SELECT {_COLUMNS}, revision FROM rollouts WHERE rollout = ?", rollout_id)
    if not rows:
        return None
    members = engine.fetch(f"SELECT {_MEMBER} FROM rollout_robots WHERE rollout = ? ORDER BY place", rollout_id)
    return _rollout(rows[0], members), int(rows[0][8])


def list_rollouts(engine: StoreEngine, *, limit: int) -> list[Rollout]:
    """The newest rollouts with their robots, the newest first."""
    rows = engine.fetch(f"SELECT {_COLUMNS} FROM rollouts ORDER BY created_ns DESC, rollout DESC LIMIT ?", limit)
    found = []
    for row in rows:
        members = engine.fetch(f"SELECT {_MEMBER} FROM rollout_robots WHERE rollout = ? ORDER BY place", row[0])
        found.append(_rollout(row, members))
    return found


def open_rollouts(engine: StoreEngine) -> dict[str, int]:
    """Those that are not over, with their revisions, the oldest first."""
    states = placeholders(len(OPEN))
    rows = engine.fetch(
        f"SELECT rollout, revision FROM rollouts WHERE state IN ({states}) ORDER BY created_ns, rollout", *OPEN
    )
    return {row[0]: int(row[1]) for row in rows}


def _document(rollout: Rollout) -> str:
    return orjson.dumps({"plan": asdict(rollout.plan), "pardoned": rollout.pardoned}).decode()


def _member_row(rollout: Rollout, member: Member) -> tuple[str | int, ...]:
    return rollout.id, member.robot, member.place, member.wave, member.state, member.since_ns, member.reason


def _rollout(row: Row, members: Sequence[Row]) -> Rollout:
    document = orjson.loads(row[4])
    plan = {**document["plan"], "waves": tuple(document["plan"]["waves"])}
    return Rollout(
        id=row[0],
        state=row[1],
        reason=row[2],
        wave=row[3],
        plan=Plan(**plan),
        pardoned=document["pardoned"],
        created_by=row[5],
        created_ns=row[6],
        changed_ns=row[7],
        members={
            item[0]: Member(robot=item[0], place=item[1], wave=item[2], state=item[3], since_ns=item[4], reason=item[5])
            for item in members
        },
    )
