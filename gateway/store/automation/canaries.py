"""Canaries in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from dataclasses import asdict

import orjson

from gateway.domain.automation.canary import Canary
from gateway.store.engine import StoreEngine

__all__ = ["delete_canary", "read_canaries", "read_canary", "save_canary"]

_COLUMNS = "function, alias, document, revision"


def save_canary(engine: StoreEngine, canary: Canary) -> bool:
    """Keep a canary over the revision it has, as the next one; 0 replaces whatever there is. False: it is another."""
    document = asdict(canary)
    for name in ("function", "alias", "revision"):
        del document[name]
    text = orjson.dumps(document).decode()
    if not canary.revision:
        sql = (
            "INSERT INTO function_canaries VALUES (?, ?, ?, 1) ON CONFLICT (function, alias) DO UPDATE SET"
            " document = excluded.document, revision = function_canaries.revision + 1"
        )
        return bool(engine.execute(sql, canary.function, canary.alias, text))
    sql = (
        "UPDATE function_canaries SET document = ?, revision = revision + 1"
        " WHERE function = ? AND alias = ? AND revision = ?"
    )
    return bool(engine.execute(sql, text, canary.function, canary.alias, canary.revision))


def read_canary(engine: StoreEngine, function: str, alias: str) -> Canary | None:
    """The last canary of an alias."""
    sql = f"SELECT {_COLUMNS} FROM function_canaries WHERE function = ? AND alias = ?"
    rows = engine.fetch(sql, function, alias)
    return _canary(*rows[0]) if rows else None


def read_canaries(engine: StoreEngine) -> list[Canary]:
    """All of them."""
    return [_canary(*row) for row in engine.fetch(f"SELECT {_COLUMNS} FROM function_canaries ORDER BY function, alias")]


def delete_canary(engine: StoreEngine, function: str, alias: str) -> bool:
    """Forget it; False when there is none."""
    return bool(engine.execute("DELETE FROM function_canaries WHERE function = ? AND alias = ?", function, alias))


def _canary(function: str, alias: str, document: str, revision: int) -> Canary:
    return Canary(function=function, alias=alias, revision=int(revision), **orjson.loads(document))
