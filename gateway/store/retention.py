"""What is deleted, and when: metric chunks by age and by the store's size, oldest first, a slice at a time."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass

__all__ = ["Retention", "purge_step", "used_bytes"]

_SLICE = 500  # chunks deleted in one transaction, so that commits never wait long


@dataclass(frozen=True, slots=True, kw_only=True)
class Retention:
    """The two bounds of the store."""

    age_s: float
    size_bytes: int


def used_bytes(connection: sqlite3.Connection) -> int:
    """What the store's rows occupy: its pages without the free ones."""
    pages, free, size = (
        int(connection.execute(f"PRAGMA {name}").fetchone()[0])
        for name in ("page_count", "freelist_count", "page_size")
    )
    return (pages - free) * size


def purge_step(connection: sqlite3.Connection, retention: Retention, *, now_ns: int) -> int:
    """Delete one slice of what is too old or too much; returns how many chunks went (0: nothing left to do)."""
    before_ns = now_ns - round(retention.age_s * 1e9)
    over_size = used_bytes(connection) > retention.size_bytes
    where = "" if over_size else "WHERE stored_ns < :before "
    oldest = f"SELECT chunk FROM metric_chunks {where}ORDER BY stored_ns LIMIT :slice"
    parameters = {"before": before_ns, "slice": _SLICE}
    connection.execute("BEGIN IMMEDIATE")
    try:
        deleted = connection.execute(f"DELETE FROM metric_chunks WHERE chunk IN ({oldest})", parameters).rowcount
        connection.execute("DELETE FROM gaps WHERE stored_ns < :before", parameters)
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
    if deleted:
        connection.execute("PRAGMA incremental_vacuum(256)").fetchall()
    return int(deleted)
