"""Deletes what the retention policy expires: rows at once, objects through the ledger, a slice at a time.

A slice is one transaction, so that commits never wait long. Watermarks are kept for ever: without its watermark a
stream would be stored a second time.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from itertools import islice

from gateway.store.engine import StoreEngine
from gateway.store.fleet.recordings import remove_recording
from gateway.store.ledger import doom
from gateway.store.retention import CLASSES, Holding, PlannedDeletion, Retention, Usage, plan
from gateway.store.schema import ROW_BYTES, TABLES
from gateway.store.telemetry.levels import drop_levels, series_of

__all__ = ["Purge", "class_bytes", "oldest_holdings", "oldest_ns", "plan_of", "total_bytes"]

_SLICE = 500  # rows deleted in one transaction

_CHUNKS = ("metric_chunks", "chunk", "stored_ns", f"{TABLES['metric_chunks']} + {ROW_BYTES}", "''", "1 = 1")
_BATCHES = ("sample_batches", "batch", "stored_ns", f"{TABLES['sample_batches']} + {ROW_BYTES}", "''")
_SEGMENTS = ("segments", "segment", "stored_ns", f"size_bytes + {ROW_BYTES}", "object")
_RECORDINGS = (
    "recordings",
    "recording",
    "requested_ns",
    "CASE WHEN state = 'stored' THEN size_bytes ELSE 0 END",
    "coalesce(object, '')",
    "state IN ('stored', 'failed')",
)
_SOURCES: dict[str, tuple[tuple[str, str, str, str, str, str], ...]] = {
    "metric": (_CHUNKS,),
    # Of what was stored in one moment the segments go first: they hold the lower numbers of a stream.
    "bulk": ((*_SEGMENTS, "event = 0"), (*_BATCHES, "event = 0")),
    "event": ((*_SEGMENTS, "event = 1"), (*_BATCHES, "event = 1")),
    "recording": (_RECORDINGS,),
}


def oldest_holdings(engine: StoreEngine, name: str) -> Iterator[Holding]:
    """A class's holdings by the time they were stored; each page of them is a snapshot of its own."""
    return heapq.merge(*(_pages(engine, name, *source) for source in _SOURCES[name]), key=lambda item: item.stored_ns)


def class_bytes(engine: StoreEngine, name: str, *, since_ns: int = 0) -> int:
    """What a class holds in all, or of what was stored since; inside a transaction of the caller's."""
    sums = [
        f"(SELECT coalesce(sum({size}), 0) FROM {table} WHERE {condition} AND {time} >= ?)"
        for table, _, time, size, _, condition in _SOURCES[name]
    ]
    if name == "metric":
        size = f"{TABLES['metric_batches']} + {ROW_BYTES}"
        sums.append(f"(SELECT coalesce(sum({size}), 0) FROM metric_batches WHERE stored_ns >= ?)")
    return int(engine.fetch(f"SELECT CAST({' + '.join(sums)} AS BIGINT)", *[since_ns] * len(sums))[0][0])


def oldest_ns(engine: StoreEngine, name: str) -> int | None:
    """When the oldest of a class was stored; inside a transaction of the caller's."""
    lowest = [
        engine.fetch(f"SELECT min({time}) FROM {table} WHERE {condition}")[0][0]
        for table, _, time, _, _, condition in _SOURCES[name]
    ]
    return min((int(found) for found in lowest if found is not None), default=None)


def total_bytes(engine: StoreEngine) -> int:
    """What database and object store hold together; outside of a transaction."""
    with engine.transaction(write=False):
        objects = engine.fetch(
            "SELECT CAST(coalesce(sum(size_bytes), 0) AS BIGINT) FROM objects WHERE state = 'stored'"
        )
    return engine.used_bytes() + int(objects[0][0])


def plan_of(engine: StoreEngine, retention: Retention, *, now_ns: int) -> Iterator[PlannedDeletion]:
    """What is to go of this store, as it is now."""
    bounded = [name for name in CLASSES if retention.limit(name).size_bytes is not None]
    with engine.transaction(write=False):
        classes = {name: class_bytes(engine, name) for name in bounded}
    usage = Usage(total_bytes(engine), classes)
    return plan(retention, usage, lambda name: oldest_holdings(engine, name), now_ns=now_ns)


class Purge:
    """One purge, slice by slice."""

    def __init__(self, engine: StoreEngine, retention: Retention, *, now_ns: int) -> None:
        self._engine = engine
        self._retention = retention
        self._now_ns = now_ns
        self._plan: Iterator[PlannedDeletion] | None = None
        self._gaps_left = True

    def step(self) -> int:
        """Delete the next slice; how many rows went (0: it is done)."""
        if self._plan is None:
            self._plan = plan_of(self._engine, self._retention, now_ns=self._now_ns)
        going = list(islice(self._plan, _SLICE))
        if going:
            with self._engine.transaction(write=True):
                _delete(self._engine, [item.holding for item in going], self._now_ns)
            deleted = len(going)
        else:
            deleted = self._delete_gaps()
        if deleted:
            self._engine.vacuum()
        return deleted

    def _delete_gaps(self) -> int:
        """Last, so that a loss is on record as long as there is anything on both sides of it."""
        if not self._gaps_left:
            return 0
        self._gaps_left = False
        with self._engine.transaction(write=True):
            before_ns = self._retention.gaps_before_ns(now_ns=self._now_ns)
            return self._engine.execute("DELETE FROM gaps WHERE stored_ns < ?", before_ns)


def _delete(engine: StoreEngine, holdings: Sequence[Holding], now_ns: int) -> None:
    by_table: dict[str, list[Holding]] = {}
    for holding in holdings:
        by_table.setdefault(holding.table, []).append(holding)
    chunks = series_of(engine, [int(item.key) for item in by_table.get("metric_chunks", ())])
    for table, key in (("metric_chunks", "chunk"), ("sample_batches", "batch")):
        engine.many(f"DELETE FROM {table} WHERE {key} = ?", [(item.key,) for item in by_table.get(table, ())])
    drop_levels(engine, chunks)
    for item in by_table.get("segments", ()):
        engine.execute("DELETE FROM segment_runs WHERE segment = ?", item.key)
        if engine.execute("DELETE FROM segments WHERE segment = ?", item.key):
            doom(engine, item.object, now_ns)
    for item in by_table.get("recordings", ()):
        gone = remove_recording(engine, str(item.key))
        if gone is not None and gone.object:
            doom(engine, gone.object, now_ns)


def _pages(
    engine: StoreEngine, kind: str, table: str, key: str, time: str, size: str, name: str, condition: str
) -> Iterator[Holding]:
    """The rows of one table in order of their times, a page at a time."""
    query = (
        f"SELECT {key}, {time}, {size}, {name} FROM {table} WHERE {condition} AND ({time}, {key}) > (?, ?)"
        f" ORDER BY {time}, {key} LIMIT {_SLICE}"
    )
    last: tuple[int, int | str] = (-(1 << 62), "" if table == "recordings" else 0)
    while True:
        with engine.transaction(write=False):
            rows = engine.fetch(query, *last)
        for row in rows:
            yield Holding(kind, table, row[0], row[1], row[2], row[3])
        if len(rows) < _SLICE:
            return
        last = (rows[-1][1], rows[-1][0])
