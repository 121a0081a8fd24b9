"""What is deleted, and when: by age, and by the store's size, the oldest first, a slice at a time.

Events and the record of what was lost are kept longest. Watermarks are kept for ever: without its watermark a stream
would be stored a second time.
"""

from __future__ import annotations

from dataclasses import dataclass

from gateway.store.engine import StoreEngine
from gateway.store.schema import ROW_BYTES, TABLES

__all__ = ["Purge", "Retention"]

_SLICE = 500  # rows deleted in one transaction, so that commits never wait long


@dataclass(frozen=True, slots=True, kw_only=True)
class Retention:
    """The bounds of the store: how old data, and events, may get, and how much all of it may be."""

    age_s: float
    size_bytes: int
    event_age_s: float | None = None  # None: as everything else

    def before_ns(self, *, now_ns: int, events: bool) -> int:
        """What was stored before this time is too old."""
        age_s = self.event_age_s if events and self.event_age_s is not None else self.age_s
        return now_ns - round(age_s * 1e9)


class Purge:
    """One purge, slice by slice."""

    def __init__(self, engine: StoreEngine, retention: Retention, *, now_ns: int) -> None:
        self._engine = engine
        self._retention = retention
        self._now_ns = now_ns
        self._excess: int | None = None

    def step(self) -> int:
        """Delete one slice of what is too old, then of what is too much; how many rows went (0: it is done)."""
        deleted = _by_age(self._engine, self._retention, self._now_ns)
        if not deleted:
            if self._excess is None:
                self._excess = self._engine.used_bytes() - self._retention.size_bytes
            if self._excess > 0:
                deleted, size_bytes = _by_size(self._engine, self._excess)
                self._excess -= size_bytes
        if deleted and self._engine.vacuum:
            self._engine.fetch(self._engine.vacuum)
        return deleted


def _by_age(engine: StoreEngine, retention: Retention, now_ns: int) -> int:
    data_ns = retention.before_ns(now_ns=now_ns, events=False)
    event_ns = retention.before_ns(now_ns=now_ns, events=True)
    with engine.transaction(write=True):
        return (
            _delete(engine, "metric_chunks", "chunk", "stored_ns < ?", data_ns)
            + _delete(engine, "sample_batches", "batch", "event = 0 AND stored_ns < ?", data_ns)
            + _delete(engine, "sample_batches", "batch", "event = 1 AND stored_ns < ?", event_ns)
            + engine.execute("DELETE FROM gaps WHERE stored_ns < ?", event_ns)
        )


def _delete(engine: StoreEngine, table: str, key: str, condition: str, value: int) -> int:
    oldest = f"SELECT {key} FROM {table} WHERE {condition} ORDER BY stored_ns LIMIT {_SLICE}"
    return engine.execute(f"DELETE FROM {table} WHERE {key} IN ({oldest})", value)


def _by_size(engine: StoreEngine, excess: int) -> tuple[int, int]:
    """The oldest slice of samples and series together, as much as is too much; events when nothing else is left.

    Returns how many rows went, and their bytes.
    """
    freed = 0
    listing = " UNION ALL ".join(
        f"SELECT * FROM (SELECT '{table}' AS name, {key} AS number, stored_ns, {TABLES[table]} AS size FROM {table}"
        f" WHERE {condition} ORDER BY stored_ns LIMIT {_SLICE}) AS {alias}"
        for alias, table, key, condition in (
            ("a", "metric_chunks", "chunk", "1 = 1"),
            ("b", "sample_batches", "batch", "event = 0"),
        )
    )
    events = (
        f"SELECT 'sample_batches', batch, stored_ns, {TABLES['sample_batches']} FROM sample_batches"
        f" WHERE event = 1 ORDER BY stored_ns LIMIT {_SLICE}"
    )
    with engine.transaction(write=True):
        rows = engine.fetch(f"{listing} ORDER BY stored_ns") or engine.fetch(events)
        going: dict[str, list[tuple[int]]] = {"metric_chunks": [], "sample_batches": []}
        for table, number, _, size in rows:
            if freed >= excess:
                break
            going[table].append((number,))
            freed += size + ROW_BYTES
        engine.many("DELETE FROM metric_chunks WHERE chunk = ?", going["metric_chunks"])
        engine.many("DELETE FROM sample_batches WHERE batch = ?", going["sample_batches"])
    return sum(map(len, going.values())), freed
