"""Holds on the object store: while somebody copies it nothing is deleted; each hold lasts for a limited time.

What a snapshot of the database refers to is then there until it was copied, whatever compaction and retention doom
meanwhile. A copier that was killed holds nothing once its time is over. Every function runs inside a transaction of
the caller's.
"""

from __future__ import annotations

from gateway.store.engine import StoreEngine

__all__ = ["HOLD", "HOLD_S", "hold_objects", "objects_held", "release_objects"]

HOLD = "hold/"  # begins the keys in `meta`; the holder's name follows
HOLD_S = 600.0  # renew it well before


def hold_objects(engine: StoreEngine, holder: str, *, now_ns: int) -> None:
    """From this transaction's commit on no object goes for `HOLD_S`."""
    until_ns = now_ns + round(HOLD_S * 1e9)
    put = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"
    engine.execute(put, f"{HOLD}{holder}", str(until_ns))


def release_objects(engine: StoreEngine, holder: str) -> None:
    """The holder has what it wanted."""
    engine.execute("DELETE FROM meta WHERE key = ?", f"{HOLD}{holder}")


def objects_held(engine: StoreEngine, *, now_ns: int) -> bool:
    """Whether anybody holds the objects now; nobody does for longer than `HOLD_S` at once, whatever a clock says."""
    rows = engine.fetch("SELECT value FROM meta WHERE key LIKE 'hold/%'")
    return any(now_ns < int(row[0]) <= now_ns + round(2 * HOLD_S * 1e9) for row in rows)
