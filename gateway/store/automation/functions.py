"""Functions in the database: records, their code's objects and the count of changes.

Every function runs inside a transaction of the caller's. What a document says is a matter of
`gateway.automation.functions`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gateway.store.engine import Row, StoreEngine

__all__ = [
    "Record",
    "StoredCode",
    "code_bytes",
    "drop_unused_code",
    "find_code",
    "get_record",
    "keep_code",
    "link_secret",
    "list_records",
    "next_change",
    "put_record",
    "read_change",
    "read_records",
    "remove_record",
]

LINK_SECRET = "function_link_secret"  # in `meta`
_COLUMNS = "kind, owner, id, document"


@dataclass(frozen=True, slots=True)
class Record:
    """One row: what it is, whose it is, its name among those, and the rest as JSON."""

    kind: str
    owner: str
    id: str
    document: Mapping[str, Any] = field(default_factory=dict)

    @property
    def code(self) -> str:
        """The SHA-256 of its code, hexadecimal; "" where it has none."""
        return str(self.document.get("code", ""))


@dataclass(frozen=True, slots=True)
class StoredCode:
    """A zip file in the object store."""

    sha256: str
    object: str
    size_bytes: int


def get_record(engine: StoreEngine, kind: str, owner: str, record_id: str) -> Record | None:
    """One record; nobody else changes it until the transaction is over."""
    sql = f"SELECT {_COLUMNS} FROM lambda_records WHERE kind = ? AND owner = ? AND id = ? {engine.for_update}"
    rows = engine.fetch(sql, kind, owner, record_id)
    return _record(rows[0]) if rows else None


def list_records(engine: StoreEngine, kind: str, owner: str | None = None) -> list[Record]:
    """The records of a kind, of one owner or of all, by owner and id."""
    some, values = ("", (kind,)) if owner is None else (" AND owner = ?", (kind, owner))
    sql = f"SELECT {_COLUMNS} FROM lambda_records WHERE kind = ?{some} ORDER BY owner, id"
    return [_record(row) for row in engine.fetch(sql, *values)]


def read_records(engine: StoreEngine) -> list[Record]:
    """Every record there is."""
    return [_record(row) for row in engine.fetch(f"SELECT {_COLUMNS} FROM lambda_records")]


def put_record(engine: StoreEngine, record: Record) -> None:
    """Add a record, or put it in place of the one of that name."""
    engine.execute(
        "INSERT INTO lambda_records (kind, owner, id, code, document) VALUES (?, ?, ?, ?, ?)"
        " ON CONFLICT (kind, owner, id) DO UPDATE SET code = excluded.code, document = excluded.document",
        record.kind,
        record.owner,
        record.id,
        record.code,
        json.dumps(dict(record.document), separators=(",", ":")),
    )


def remove_record(engine: StoreEngine, kind: str, owner: str, record_id: str) -> None:
    """The record is gone, whether it was there or not."""
    engine.execute("DELETE FROM lambda_records WHERE kind = ? AND owner = ? AND id = ?", kind, owner, record_id)


def next_change(engine: StoreEngine) -> int:
    """Count a change; whoever changes takes their turn here, so that two never decide on the same state."""
    engine.execute("UPDATE lambda_changes SET number = number + 1 WHERE one = 1")
    return read_change(engine)


def read_change(engine: StoreEngine) -> int:
    """How many changes there were."""
    return int(engine.fetch("SELECT number FROM lambda_changes WHERE one = 1")[0][0])


def keep_code(engine: StoreEngine, code: StoredCode, *, now_ns: int) -> StoredCode:
    """Where this code is, or is to be written: under the name of `code` unless it is kept already."""
    engine.execute(
        "INSERT INTO lambda_code (sha256, object, size_bytes, touched_ns) VALUES (?, ?, ?, ?)"
        " ON CONFLICT (sha256) DO UPDATE SET touched_ns = excluded.touched_ns",
        code.sha256,
        code.object,
        code.size_bytes,
        now_ns,
    )
    found = find_code(engine, code.sha256)
    return found if found is not None else code


def find_code(engine: StoreEngine, sha256: str) -> StoredCode | None:
    """Where code lies."""
    rows = engine.fetch("SELECT sha256, object, size_bytes FROM lambda_code WHERE sha256 = ?", sha256)
    return StoredCode(*rows[0]) if rows else None


def code_bytes(engine: StoreEngine) -> int:
    """What all kept code takes, each zip once."""
    return int(engine.fetch("SELECT coalesce(sum(size_bytes), 0) FROM lambda_code")[0][0])


def drop_unused_code(engine: StoreEngine, *, before_ns: int, limit: int) -> list[str]:
    """Forget code that no record has and nobody has wanted to keep since; the names of its objects, to be deleted."""
    rows = engine.fetch(
        "SELECT sha256, object FROM lambda_code WHERE touched_ns < ? AND NOT EXISTS"
        " (SELECT 1 FROM lambda_records WHERE lambda_records.code = lambda_code.sha256) ORDER BY sha256 LIMIT ?",
        before_ns,
        limit,
    )
    dropped = [row for row in rows if engine.execute(_DROP, row[0], before_ns)]
    return [str(row[1]) for row in dropped]


def link_secret(engine: StoreEngine, fresh: str) -> str:
    """The store's secret behind links to code: `fresh` where there was none."""
    engine.execute("INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO NOTHING", LINK_SECRET, fresh)
    return str(engine.fetch("SELECT value FROM meta WHERE key = ?", LINK_SECRET)[0][0])


_DROP = "DELETE FROM lambda_code WHERE sha256 = ? AND touched_ns < ?"


def _record(row: Row) -> Record:
    return Record(row[0], row[1], row[2], json.loads(row[3]))
