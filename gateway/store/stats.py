"""Storage use: by class, robot and table, and in the object store."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.store.engine import StoreEngine
from gateway.store.integrity.check import Report, last_report
from gateway.store.purge import class_bytes, oldest_ns, total_bytes
from gateway.store.retention import CLASSES
from gateway.store.schema import ROW_BYTES, TABLES

__all__ = ["ClassUse", "ObjectUse", "Stats", "TableUse", "read_stats"]

DAY_S, HOUR_S = 86400, 3600
_ROBOTS = 1000
_COUNTED = ("segment_runs", "segments", "recordings", "objects", "gaps", "streams", "series", "channels")
_BY_ROBOT = f"""
    SELECT r.id, CAST(sum(size) AS BIGINT) FROM (
        SELECT s.robot AS robot, {TABLES["metric_chunks"]} + {ROW_BYTES} AS size
            FROM metric_chunks m JOIN series s ON s.series = m.series
        UNION ALL SELECT robot, {TABLES["metric_batches"]} + {ROW_BYTES} FROM metric_batches
        UNION ALL SELECT robot, {TABLES["sample_batches"]} + {ROW_BYTES} FROM sample_batches
        UNION ALL SELECT robot, size_bytes + {ROW_BYTES} FROM segments
        UNION ALL SELECT robot, size_bytes FROM recordings WHERE state = 'stored'
    ) AS held JOIN robots r ON r.robot = held.robot GROUP BY r.id ORDER BY 2 DESC, 1 LIMIT {_ROBOTS}
"""


@dataclass(frozen=True, slots=True)
class ClassUse:
    """What a class holds, when the oldest of it was stored, and what a day brings; None: not known yet."""

    name: str
    size_bytes: int
    oldest_ns: int | None
    bytes_per_day: float | None


@dataclass(frozen=True, slots=True)
class TableUse:
    """A table of the database."""

    name: str
    rows: int
    size_bytes: int


@dataclass(frozen=True, slots=True)
class ObjectUse:
    """The objects by what the ledger calls them."""

    stored: int
    size_bytes: int
    uploading: int
    doomed: int


@dataclass(frozen=True, slots=True)
class Stats:
    """All of it, and the last check."""

    total_bytes: int
    classes: list[ClassUse]
    robots: list[tuple[str, int]]
    tables: list[TableUse]
    objects: ObjectUse
    checked: Report | None


def read_stats(engine: StoreEngine, *, now_ns: int) -> Stats:
    """Count; every table is gone through, so ask rarely."""
    total = total_bytes(engine)
    with engine.transaction(write=False):
        began = engine.fetch("SELECT min(first_seen_ns) FROM robots")[0][0]
        old_enough = began is not None and now_ns - began >= HOUR_S * 10**9
        classes = [_class_use(engine, name, now_ns, old_enough) for name in CLASSES]
        robots = [(str(row[0]), int(row[1])) for row in engine.fetch(_BY_ROBOT)]
        tables = [_table_use(engine, name) for name in (*TABLES, *_COUNTED)]
        return Stats(total, classes, robots, tables, _object_use(engine), last_report(engine))


def _class_use(engine: StoreEngine, name: str, now_ns: int, old_enough: bool) -> ClassUse:
    """A day's growth is what the last day brought, or what the class has brought since it began."""
    size_bytes, first_ns = class_bytes(engine, name), oldest_ns(engine, name)
    per_day: float | None = None
    if old_enough:
        age_s = (now_ns - first_ns) / 1e9 if first_ns is not None else DAY_S
        window_s = min(DAY_S, max(HOUR_S, age_s))
        recent = class_bytes(engine, name, since_ns=now_ns - round(window_s * 1e9))
        per_day = recent * DAY_S / window_s
    return ClassUse(name, size_bytes, first_ns, per_day)


def _table_use(engine: StoreEngine, name: str) -> TableUse:
    size = TABLES.get(name, "0")
    row = engine.fetch(f"SELECT count(*), CAST(coalesce(sum({size}), 0) AS BIGINT) FROM {name}")[0]
    return TableUse(name, int(row[0]), int(row[1]) + ROW_BYTES * int(row[0]))


def _object_use(engine: StoreEngine) -> ObjectUse:
    rows = engine.fetch("SELECT state, count(*), CAST(sum(size_bytes) AS BIGINT) FROM objects GROUP BY state")
    found = {row[0]: (int(row[1]), int(row[2])) for row in rows}
    none = (0, 0)
    stored = found.get("stored", none)
    return ObjectUse(*stored, found.get("uploading", none)[0], found.get("doomed", none)[0])
