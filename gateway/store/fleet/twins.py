"""Twins in the database: desired documents with their history, and what robots reported last.

Every function runs inside a transaction of the caller's. Whoever changes a twin or a template calls `next_change`
first: its lock makes the changes of all gateways follow one another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence

import orjson

from gateway.domain.fleet.twin import Desired, Reported, TwinEntry
from gateway.store.engine import Row, StoreEngine, placeholders, slices
from metaros.limits import LIMITS

__all__ = [
    "HISTORY",
    "changed_twins",
    "collect_documents",
    "newest_change",
    "next_change",
    "read_history",
    "read_labels",
    "read_reports",
    "read_twins",
    "write_reports",
    "write_twins",
]

HISTORY = LIMITS.twin_history  # entries of each robot that are shown; older ones go
KEPT = HISTORY + 1  # one more, to say what the oldest that is shown changed
_COLUMNS = (
    "robot, revision, edition, change, own, document, labels, templates, problem, author, at_ns, reason, confirm_ms"
)
_REPORT = "robot, at_ns, revision, applied, state, code, message, hash, reported"


def next_change(engine: StoreEngine, *, templates: bool = False) -> int:
    """The number of this transaction's change; others wait for their turn until it is over."""
    engine.execute("UPDATE twin_changes SET change = change + 1 WHERE id = 1")
    number = int(engine.fetch("SELECT change FROM twin_changes WHERE id = 1")[0][0])
    if templates:
        engine.execute("UPDATE twin_changes SET templates = ? WHERE id = 1", number)
    return number


def newest_change(engine: StoreEngine) -> tuple[int, int]:
    """The newest change of all, and the newest of a template."""
    row = engine.fetch("SELECT change, templates FROM twin_changes WHERE id = 1")[0]
    return int(row[0]), int(row[1])


def read_labels(engine: StoreEngine, robots: Collection[str] | None = None) -> dict[str, dict[str, str]]:
    """What robots said of themselves in their last Hello, by robot; None: every one that ever connected."""
    if robots is None:
        rows: list[Row] = list(engine.fetch("SELECT id, labels FROM robots"))
    else:
        rows = _in(engine, "SELECT id, labels FROM robots WHERE id IN", robots)
    return {row[0]: orjson.loads(row[1]) for row in rows}


def read_twins(engine: StoreEngine, robots: Collection[str] | None = None) -> dict[str, Desired]:
    """What is stored, by robot; a robot of which nobody ever said anything is not among them."""
    if robots is None:
        rows: list[Row] = list(engine.fetch(f"SELECT {_COLUMNS} FROM twins"))
    else:
        rows = _in(engine, f"SELECT {_COLUMNS} FROM twins WHERE robot IN", robots)
    return {item.robot: item for item in _desired(engine, rows)}


def changed_twins(engine: StoreEngine, since: int) -> list[Desired]:
    """What changed after that change, in order."""
    return _desired(engine, engine.fetch(f"SELECT {_COLUMNS} FROM twins WHERE change > ? ORDER BY change", since))


def write_twins(engine: StoreEngine, items: Sequence[Desired]) -> None:
    """Store new states, each with an entry in its robot's history."""
    documents = {_hash(data): data for item in items for data in (item.own, item.document)}
    engine.many("INSERT INTO twin_documents VALUES (?, ?) ON CONFLICT DO NOTHING", list(documents.items()))
    names = [name.strip() for name in _COLUMNS.split(",")]
    changes = ", ".join(f"{name} = excluded.{name}" for name in names[1:])
    engine.many(
        f"INSERT INTO twins ({_COLUMNS}) VALUES ({placeholders(len(names))})"
        f" ON CONFLICT (robot) DO UPDATE SET {changes}",
        [_row(item) for item in items],
    )
    engine.many(
        f"INSERT INTO twin_history VALUES ({placeholders(8)})",
        [
            (
                item.robot,
                item.edition,
                item.revision,
                item.at_ns,
                item.author,
                item.reason,
                _hash(item.own),
                _hash(item.document),
            )
            for item in items
        ],
    )
    old = [(item.robot, item.edition - KEPT) for item in items if item.edition > KEPT]
    engine.many("DELETE FROM twin_history WHERE robot = ? AND edition <= ?", old)


def read_history(
    engine: StoreEngine, robot: str, *, limit: int = HISTORY, revision: int | None = None
) -> list[TwinEntry]:
    """The robot's entries, the newest first; of one revision alone where that is given."""
    some, values = ("", (robot, limit)) if revision is None else (" AND revision = ?", (robot, revision, limit))
    rows = engine.fetch(
        "SELECT edition, revision, at_ns, author, reason, own, document FROM twin_history"
        f" WHERE robot = ?{some} ORDER BY edition DESC LIMIT ?",
        *values,
    )
    documents = _documents(engine, (digest for row in rows for digest in row[5:7]))
    return [
        TwinEntry(
            edition=row[0],
            revision=row[1],
            at_ns=row[2],
            author=row[3],
            reason=row[4],
            own=documents[row[5]],
            document=documents[row[6]],
        )
        for row in rows
    ]


def collect_documents(engine: StoreEngine) -> int:
    """Delete the documents that nothing refers to any more; how many. After `next_change`, as others add them."""
    return engine.execute(
        "DELETE FROM twin_documents WHERE hash NOT IN (SELECT own FROM twins UNION SELECT document FROM twins"
        " UNION SELECT own FROM twin_history UNION SELECT document FROM twin_history)"
    )


def write_reports(engine: StoreEngine, items: Iterable[Reported]) -> None:
    """Keep the newest report of each robot."""
    names = _REPORT.split(", ")
    changes = ", ".join(f"{name} = excluded.{name}" for name in names[1:])
    engine.many(
        f"INSERT INTO twin_reports ({_REPORT}) VALUES ({placeholders(len(names))})"
        f" ON CONFLICT (robot) DO UPDATE SET {changes}",
        [
            (
                item.robot,
                item.at_ns,
                item.revision,
                item.applied,
                item.state,
                item.code,
                item.message,
                item.sha256.hex(),
                item.reported,
            )
            for item in sorted(items, key=lambda item: item.robot)  # gateways lock rows in one order
        ],
    )


def read_reports(
    engine: StoreEngine, robots: Collection[str] | None = None, *, values_bytes: int = 1 << 20
) -> dict[str, Reported]:
    """What robots reported last, by robot; `reported` is empty where it is longer than `values_bytes`."""
    columns = _REPORT.replace(
        "hash, reported", f"hash, CASE WHEN length(reported) <= {values_bytes:d} THEN reported END"
    )
    if robots is None:
        rows: list[Row] = list(engine.fetch(f"SELECT {columns} FROM twin_reports"))
    else:
        rows = _in(engine, f"SELECT {columns} FROM twin_reports WHERE robot IN", robots)
    return {
        row[0]: Reported(
            robot=row[0],
            at_ns=row[1],
            revision=row[2],
            applied=row[3],
            state=row[4],
            code=row[5],
            message=row[6],
            sha256=bytes.fromhex(row[7]),
            reported=bytes(row[8]) if row[8] is not None else b"",
        )
        for row in rows
    }


def _row(item: Desired) -> Row:
    return (
        item.robot,
        item.revision,
        item.edition,
        item.change,
        _hash(item.own),
        _hash(item.document),
        orjson.dumps(dict(item.labels)).decode(),
        orjson.dumps(item.templates).decode(),
        item.problem,
        item.author,
        item.at_ns,
        item.reason,
        round(item.confirm_within_s * 1000),
    )


def _desired(engine: StoreEngine, rows: Sequence[Row]) -> list[Desired]:
    documents = _documents(engine, (digest for row in rows for digest in row[4:6]))
    return [
        Desired(
            robot=row[0],
            revision=row[1],
            edition=row[2],
            change=row[3],
            own=documents[row[4]],
            document=documents[row[5]],
            sha256=bytes.fromhex(row[5]),
            labels=orjson.loads(row[6]),
            templates=tuple(orjson.loads(row[7])),
            problem=row[8],
            author=row[9],
            at_ns=row[10],
            reason=row[11],
            confirm_within_s=row[12] / 1000,
        )
        for row in rows
    ]


def _documents(engine: StoreEngine, digests: Iterable[str]) -> Mapping[str, bytes]:
    rows = _in(engine, "SELECT hash, document FROM twin_documents WHERE hash IN", set(digests))
    return {row[0]: bytes(row[1]) for row in rows}


def _in(engine: StoreEngine, sql: str, values: Collection[str]) -> list[Row]:
    found: list[Row] = []
    for piece in slices(sorted(values)):
        found += engine.fetch(f"{sql} ({placeholders(len(piece))})", *piece)
    return found


def _hash(document: bytes) -> str:
    return hashlib.sha256(document).hexdigest()
