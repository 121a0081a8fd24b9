"""Hooks, and the secrets of hooks and targets, in the database. Every function runs inside a transaction of the
caller's.
"""

from __future__ import annotations

import orjson

from gateway.domain.automation.rule import Hook
from gateway.store.engine import Row, StoreEngine

__all__ = ["add_hook", "count_hook", "keep_secret", "read_hook", "read_hooks", "read_secret", "remove_hook"]

_SELECT = "SELECT hook, description, auth, robot, made_by, robots, made_ns, accepted, refused, used_ns FROM hooks"
_SECRET = """
    INSERT INTO rule_secrets VALUES (?, ?, ?)
    ON CONFLICT (owner) DO UPDATE SET sealed = excluded.sealed, made_ns = excluded.made_ns
"""


def read_hooks(engine: StoreEngine) -> list[Hook]:
    """Every hook, by name."""
    return [_hook(row) for row in engine.fetch(f"{_SELECT} ORDER BY hook")]


def read_hook(engine: StoreEngine, name: str) -> Hook | None:
    """One hook."""
    rows = engine.fetch(f"{_SELECT} WHERE hook = ?", name)
    return _hook(rows[0]) if rows else None


def add_hook(engine: StoreEngine, hook: Hook) -> bool:
    """Whether there was none of that name."""
    robots = orjson.dumps(hook.robots).decode()
    made = (hook.name, hook.description, hook.auth, hook.robot, hook.made_by, robots, hook.made_ns)
    return bool(
        engine.execute("INSERT INTO hooks VALUES (?, ?, ?, ?, ?, ?, ?, 0, 0, 0) ON CONFLICT (hook) DO NOTHING", *made)
    )


def remove_hook(engine: StoreEngine, name: str) -> bool:
    """Whether there was one; its secret goes with it."""
    engine.execute("DELETE FROM rule_secrets WHERE owner = ?", f"hook/{name}")
    return bool(engine.execute("DELETE FROM hooks WHERE hook = ?", name))


def count_hook(engine: StoreEngine, name: str, *, accepted: int = 0, refused: int = 0, now_ns: int) -> None:
    """Something came to a hook."""
    engine.execute(
        "UPDATE hooks SET accepted = accepted + ?, refused = refused + ?, used_ns = ? WHERE hook = ?",
        accepted,
        refused,
        now_ns,
        name,
    )


def keep_secret(engine: StoreEngine, owner: str, sealed: bytes, *, now_ns: int) -> None:
    """The owner's secret from now on."""
    engine.execute(_SECRET, owner, sealed, now_ns)


def read_secret(engine: StoreEngine, owner: str) -> bytes | None:
    """What the owner's secret is sealed as; None where it has none."""
    rows = engine.fetch("SELECT sealed FROM rule_secrets WHERE owner = ?", owner)
    return bytes(rows[0][0]) if rows else None


def _hook(row: Row) -> Hook:
    return Hook(
        name=row[0],
        description=row[1],
        auth=row[2],
        robot=row[3],
        made_by=row[4],
        robots=tuple(orjson.loads(row[5])),
        made_ns=row[6],
        accepted=row[7],
        refused=row[8],
        used_ns=row[9],
    )
