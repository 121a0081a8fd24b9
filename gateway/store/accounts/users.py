"""Users in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import orjson

from gateway.domain.account import User
from gateway.domain.principal import Role
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = [
    "USER_COLUMNS",
    "add_user",
    "change_user",
    "count_admins",
    "find_external",
    "find_user",
    "get_user",
    "has_admin",
    "list_users",
    "remove_user",
    "user_of",
]

USER_COLUMNS = (
    "users.id, users.name, users.role, users.robots, users.password, users.external, users.disabled,"
    " users.created_ns, users.signed_in_ns"
)
_SELECT = f"SELECT {USER_COLUMNS} FROM users"
_CHANGEABLE = frozenset({"role", "robots", "password", "external", "disabled", "signed_in_ns"})


def add_user(engine: StoreEngine, user: User) -> bool:
    """Store a new user; False when the name is taken."""
    changed = engine.execute(
        "INSERT INTO users (id, name, role, robots, password, external, disabled, created_ns, signed_in_ns)"
        f" VALUES ({placeholders(9)}) ON CONFLICT (name) DO NOTHING",
        user.id,
        user.name,
        user.role.word,
        orjson.dumps(user.robots).decode(),
        user.password,
        user.external,
        int(user.disabled),
        user.created_ns,
        user.signed_in_ns,
    )
    return bool(changed)


def find_user(engine: StoreEngine, name: str, *, lock: bool = True) -> User | None:
    """The user of that name; with `lock`, in a writing transaction, nobody else changes it until that is over."""
    return _one(engine.fetch(f"{_SELECT} WHERE name = ?{engine.for_update if lock else ''}", name))


def get_user(engine: StoreEngine, user_id: str) -> User | None:
    """The user of that id."""
    return _one(engine.fetch(f"{_SELECT} WHERE id = ?", user_id))


def find_external(engine: StoreEngine, external: str) -> User | None:
    """Who signs in elsewhere as "<issuer> <subject>"."""
    return _one(engine.fetch(f"{_SELECT} WHERE external = ?", external))


def list_users(engine: StoreEngine, *, limit: int) -> list[User]:
    """Users by name."""
    return [user_of(row) for row in engine.fetch(f"{_SELECT} ORDER BY name LIMIT ?", limit)]


def count_admins(engine: StoreEngine) -> int:
    """How many admins may sign in; nobody else changes them until the transaction is over."""
    sql = f"SELECT id FROM users WHERE role = ? AND disabled = 0 ORDER BY id{engine.for_update}"
    return len(engine.fetch(sql, Role.ADMIN.word))


def has_admin(engine: StoreEngine) -> bool:
    """Whether anybody could look after this gateway."""
    return bool(engine.fetch("SELECT 1 FROM users WHERE role = ? AND disabled = 0 LIMIT 1", Role.ADMIN.word))


def change_user(engine: StoreEngine, user_id: str, **values: Any) -> bool:
    """Set some columns; False when there is no such user."""
    if unknown := values.keys() - _CHANGEABLE:
        raise ValueError(f"no columns to change: {sorted(unknown)}")
    if not values:
        return get_user(engine, user_id) is not None
    settings = ", ".join(f"{name} = ?" for name in values)
    return bool(engine.execute(f"UPDATE users SET {settings} WHERE id = ?", *map(_stored, values.values()), user_id))


def remove_user(engine: StoreEngine, user_id: str) -> None:
    """Delete a user with their sessions, links and keys."""
    for table in ("sessions", "sign_in_links", "api_keys"):
        engine.execute(f"DELETE FROM {table} WHERE user_id = ?", user_id)
    engine.execute("DELETE FROM users WHERE id = ?", user_id)


def user_of(row: Row) -> User:
    """A user from USER_COLUMNS."""
    return User(
        id=row[0],
        name=row[1],
        role=Role.of(row[2]),
        robots=tuple(orjson.loads(row[3])),
        password=row[4],
        external=row[5],
        disabled=bool(row[6]),
        created_ns=row[7],
        signed_in_ns=row[8],
    )


def _one(rows: Sequence[Row]) -> User | None:
    return user_of(rows[0]) if rows else None


def _stored(value: Any) -> Any:
    if isinstance(value, Role):
        return value.word
    if isinstance(value, bool):
        return int(value)
    return orjson.dumps(value).decode() if isinstance(value, tuple) else value
