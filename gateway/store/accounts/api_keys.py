"""API keys in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence

import orjson

from gateway.domain.account import ApiKey, User
from gateway.domain.principal import Role
from gateway.store.accounts.users import get_user
from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = ["add_key", "count_keys", "find_key", "key_and_owner", "list_keys", "remove_key", "touch_key"]

_COLUMNS = "id, name, user_id, role, robots, scopes, secret_hash, sealed, created_ns, expires_ns, used_ns"
_SELECT = f"SELECT {_COLUMNS} FROM api_keys"


def add_key(engine: StoreEngine, key: ApiKey) -> None:
    """Store a new key."""
    engine.execute(
        f"INSERT INTO api_keys ({_COLUMNS}) VALUES ({placeholders(11)})",
        key.id,
        key.name,
        key.user_id,
        key.role.word,
        orjson.dumps(key.robots).decode(),
        orjson.dumps(sorted(key.scopes)).decode(),
        key.secret_hash,
        key.sealed,
        key.created_ns,
        key.expires_ns,
        key.used_ns,
    )


def find_key(engine: StoreEngine, key_id: str) -> ApiKey | None:
    """The key of that id, expired or not."""
    return _one(engine.fetch(f"{_SELECT} WHERE id = ?", key_id))


def key_and_owner(engine: StoreEngine, key_id: str) -> tuple[ApiKey, User | None] | None:
    """A key and whose it is."""
    key = find_key(engine, key_id)
    return (key, get_user(engine, key.user_id) if key.user_id is not None else None) if key is not None else None


def list_keys(engine: StoreEngine, *, user_id: str | None = None, limit: int) -> list[ApiKey]:
    """The newest keys of a user, or of everybody, newest first."""
    only = "" if user_id is None else " WHERE user_id = ?"
    values = () if user_id is None else (user_id,)
    sql = f"{_SELECT}{only} ORDER BY created_ns DESC, id LIMIT ?"
    return [_key(row) for row in engine.fetch(sql, *values, limit)]


def count_keys(engine: StoreEngine, user_id: str | None) -> int:
    """How many keys a user has; None: how many are nobody's."""
    if user_id is None:
        return int(engine.fetch("SELECT count(*) FROM api_keys WHERE user_id IS NULL")[0][0])
    return int(engine.fetch("SELECT count(*) FROM api_keys WHERE user_id = ?", user_id)[0][0])


def touch_key(engine: StoreEngine, key_id: str, *, now_ns: int) -> None:
    """It was used."""
    engine.execute("UPDATE api_keys SET used_ns = ? WHERE id = ?", now_ns, key_id)


def remove_key(engine: StoreEngine, key_id: str) -> bool:
    """Delete a key with its sealed secret; False when there is none."""
    return bool(engine.execute("DELETE FROM api_keys WHERE id = ?", key_id))


def _one(rows: Sequence[Row]) -> ApiKey | None:
    return _key(rows[0]) if rows else None


def _key(row: Row) -> ApiKey:
    return ApiKey(
        id=row[0],
        name=row[1],
        user_id=row[2],
        role=Role.of(row[3]),
        robots=tuple(orjson.loads(row[4])),
        scopes=frozenset(orjson.loads(row[5])),
        secret_hash=row[6],
        sealed=bytes(row[7]) if row[7] is not None else None,
        created_ns=row[8],
        expires_ns=row[9],
        used_ns=row[10],
    )
