"""The audit log in the database: rows are appended to one chain, read by page, and proven one after another.

A row's hash is SHA-256 over b"metaros audit 1\\0", the 32 bytes of the hash before it, and the row's other columns as
a JSON list. The first row's hash before is SHA-256 of b"metaros audit 1\\0" and the store's id, so no chain passes for
that of another store. `append` runs inside a writing transaction of the caller's; the others open their own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Any, NamedTuple

import orjson

from gateway.store.engine import Row, StoreEngine, placeholders, slices

__all__ = [
    "AuditEvent",
    "AuditFault",
    "AuditHead",
    "AuditRow",
    "append",
    "read_hashes",
    "read_head",
    "read_page",
    "verify_rows",
]

_MARK = b"metaros audit 1\0"
_COLUMNS = (
    "number, at_ns, gateway, kind, actor, name, role, address, action, method, target, status, code, detail, hash"
)
TEXT_CHARS = {"target": 512, "detail": 1000}
SHORT_CHARS = 128


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditEvent:
    """What happened. `kind`, `actor` (an id), `name` and `role` are those of the principal; `action` is a permission,
    or a word of the log's own; `status` is as in HTTP.
    """

    at_ns: int
    gateway: str = ""
    kind: str = ""
    actor: str = ""
    name: str = ""
    role: str = ""
    address: str = ""
    action: str = ""
    method: str = ""
    target: str = ""
    status: int = 0
    code: str = ""
    detail: str = ""

    def clean(self) -> AuditEvent:
        """The same as both databases keep it: short, and without control characters."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        texts = {key: value for key, value in values.items() if isinstance(value, str)}
        cleaned: dict[str, Any] = {key: _clean(text, TEXT_CHARS.get(key, SHORT_CHARS)) for key, text in texts.items()}
        return replace(self, **cleaned)


class AuditRow(NamedTuple):
    """A row of the log."""

    number: int
    event: AuditEvent
    hash: str


class AuditHead(NamedTuple):
    """The end of a chain; number 0 and "" of an empty one."""

    number: int
    hash: str


class AuditFault(NamedTuple):
    """What does not hold, from which row on: `hash`, `missing` or `head`."""

    number: int
    fault: str
    detail: str


def append(engine: StoreEngine, events: Sequence[AuditEvent]) -> AuditHead:
    """Write some events at the end of the chain; nobody else appends until the transaction is over."""
    rows = engine.fetch(f"SELECT number, hash FROM audit_head WHERE id = 1{engine.for_update}")
    number, digest = int(rows[0][0]), _start(engine, rows[0][1])
    new: list[Row] = []
    for event in events:
        number += 1
        columns = (number, *astuple(event.clean()))
        digest = _hash(digest, columns)
        new.append((*columns, digest.hex()))
    engine.many(f"INSERT INTO audit ({_COLUMNS}) VALUES ({placeholders(15)})", new)
    engine.execute("UPDATE audit_head SET number = ?, hash = ? WHERE id = 1", number, digest.hex())
    return AuditHead(number, digest.hex())


def read_head(engine: StoreEngine) -> AuditHead:
    """The newest row's number and hash, as the head says."""
    with engine.transaction(write=False):
        return AuditHead(*engine.fetch("SELECT number, hash FROM audit_head WHERE id = 1")[0])


def read_hashes(engine: StoreEngine, numbers: Sequence[int]) -> dict[int, str]:
    """The hashes of some rows, as far as they are there."""
    found: dict[int, str] = {}
    with engine.transaction(write=False):
        for some in slices(numbers):
            sql = f"SELECT number, hash FROM audit WHERE number IN ({placeholders(len(some))})"
            found.update((row[0], str(row[1])) for row in engine.fetch(sql, *some))
    return found


def read_page(
    engine: StoreEngine, *, before: int | None = None, limit: int, action: str = "", name: str = ""
) -> list[AuditRow]:
    """Rows with a number below `before`, the newest first; `action` and `name` are exact."""
    wanted: dict[str, int | str] = {}
    if before is not None:
        wanted["number < ?"] = before
    if action:
        wanted["action = ?"] = action
    if name:
        wanted["name = ?"] = name
    where = f" WHERE {' AND '.join(wanted)}" if wanted else ""
    sql = f"SELECT {_COLUMNS} FROM audit{where} ORDER BY number DESC LIMIT ?"
    with engine.transaction(write=False):
        return [_row(row) for row in engine.fetch(sql, *wanted.values(), limit)]


def verify_rows(engine: StoreEngine, known: AuditHead, *, limit: int) -> tuple[AuditHead, list[AuditFault], bool]:
    """Prove at most `limit` rows after a proven one; AuditHead(0, "") begins.

    Returns:
        The last row that was looked at, what does not hold, and whether there may be more. After a row with a wrong
        hash the proof goes on with the hash that is stored, so that one change is not a fault of every later row.
    """
    with engine.transaction(write=False):
        digest = _start(engine, known.hash)
        sql = f"SELECT {_COLUMNS} FROM audit WHERE number > ? ORDER BY number LIMIT ?"
        rows = engine.fetch(sql, known.number if known.hash else -(1 << 63), limit)
        head = AuditHead(*engine.fetch("SELECT number, hash FROM audit_head WHERE id = 1")[0])
    number, last = known
    faults: list[AuditFault] = []
    for row in rows:
        if row[0] != number + 1:
            faults.append(AuditFault(number + 1, "missing", f"rows {number + 1} to {row[0] - 1} are not there"))
        elif _hash(digest, tuple(row[:-1])).hex() != row[-1]:
            faults.append(AuditFault(row[0], "hash", "the row, or the one before it, is not what was written"))
        number, last, digest = row[0], str(row[-1]), _bytes(str(row[-1]))
    end, more = AuditHead(number, last), len(rows) == limit
    if not more and head != end:
        faults.append(AuditFault(number, "head", f"the last row is {number}, the head is of {head.number} or differs"))
    return end, faults, more


def _start(engine: StoreEngine, before: str) -> bytes:
    """The 32 bytes that go into the next row's hash."""
    if before:
        return _bytes(before)
    store_id = str(engine.fetch("SELECT value FROM meta WHERE key = 'store_id'")[0][0])
    return hashlib.sha256(_MARK + store_id.encode()).digest()


def _hash(before: bytes, columns: Row) -> bytes:
    return hashlib.sha256(_MARK + before + orjson.dumps(columns, default=repr)).digest()


def _bytes(text: str) -> bytes:
    """A stored hash; of one that is none something that no row's hash follows from."""
    try:
        return bytes.fromhex(text)
    except ValueError:
        return text.encode("utf-8", "replace")


def _row(row: Row) -> AuditRow:
    names = _COLUMNS.split(", ")[1:-1]
    return AuditRow(row[0], AuditEvent(**dict(zip(names, row[1:-1], strict=True))), row[-1])


def _clean(text: str, chars: int) -> str:
    kept = "".join(char if char.isprintable() else "\ufffd" for char in text[:chars])
    return kept.encode("utf-8", "replace").decode()
