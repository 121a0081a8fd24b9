"""The background merge: metric batches, as they came, become chunks of about 1000 samples a series.

One step is one transaction: the rows enter their chunks and the batches leave, or neither. A reader's snapshot
therefore sees every row exactly once, before, during and after.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gateway.store.engine import StoreEngine
from gateway.store.schema import CHUNK_SAMPLES

__all__ = ["merge_step", "waiting_batches"]

Stamps = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


def waiting_batches(engine: StoreEngine) -> tuple[int, int]:
    """(how many batches wait for the merge, when the oldest of them was stored); the time is 0 when none waits."""
    with engine.transaction(write=False):
        count = engine.fetch("SELECT count(*) FROM metric_batches")[0][0]
        oldest = engine.fetch("SELECT stored_ns FROM metric_batches ORDER BY batch LIMIT 1")
    return int(count), int(oldest[0][0]) if oldest else 0


def merge_step(engine: StoreEngine, *, max_batches: int) -> int:
    """Move the rows of at most `max_batches` batches into chunks; returns how many batches went."""
    with engine.transaction(write=True):
        return _move(engine, max_batches)


def _move(engine: StoreEngine, max_batches: int) -> int:
    query = "SELECT batch, stored_ns, series, stamps, vals FROM metric_batches ORDER BY batch LIMIT ?"
    batches = engine.fetch(query + engine.for_update, max_batches)
    if not batches:
        return 0
    series = np.frombuffer(b"".join(batch[2] for batch in batches), np.uint32)
    stamps = np.frombuffer(b"".join(batch[3] for batch in batches), np.int64)
    values = np.frombuffer(b"".join(batch[4] for batch in batches), np.float64)
    order = np.argsort(series, kind="stable")
    series, stamps, values = series[order], stamps[order], values[order]
    numbers, starts = np.unique(series, return_index=True)
    bounds = [*starts.tolist(), len(series)]
    stored_ns = max(batch[1] for batch in batches)
    for index, number in enumerate(numbers.tolist()):
        rows = slice(bounds[index], bounds[index + 1])
        _append(engine, number, stamps[rows], values[rows], stored_ns)
    engine.many("DELETE FROM metric_batches WHERE batch = ?", [(batch[0],) for batch in batches])
    return len(batches)


def _append(engine: StoreEngine, series: int, stamps: Stamps, values: Values, stored_ns: int) -> None:
    """Fill the series' open chunk, then make new ones."""
    find = (
        "SELECT chunk, count, stamps, vals FROM metric_chunks WHERE series = ? AND count < 1000"
        " ORDER BY chunk DESC LIMIT 1"
    )
    for row in engine.fetch(find + engine.for_update, series):
        taken = min(len(stamps), CHUNK_SAMPLES - row[1])
        held = (np.frombuffer(row[2], np.int64), np.frombuffer(row[3], np.float64))
        joined = _chunk(np.concatenate((held[0], stamps[:taken])), np.concatenate((held[1], values[:taken])))
        engine.execute(
            "UPDATE metric_chunks SET first_ns = ?, last_ns = ?, count = ?, stamps = ?, vals = ?, stored_ns = ?"
            " WHERE chunk = ?",
            *joined,
            stored_ns,
            row[0],
        )
        stamps, values = stamps[taken:], values[taken:]
    pieces = [slice(start, start + CHUNK_SAMPLES) for start in range(0, len(stamps), CHUNK_SAMPLES)]
    engine.many(
        "INSERT INTO metric_chunks (first_ns, last_ns, count, stamps, vals, stored_ns, series)"
        " VALUES (?, ?, ?, ?, ?, ?, ?)",
        [(*_chunk(stamps[piece], values[piece]), stored_ns, series) for piece in pieces],
    )


def _chunk(stamps: Stamps, values: Values) -> tuple[int, int, int, bytes, bytes]:
    """A chunk's columns, sorted by stamp: a robot's clock may have been set back."""
    if len(stamps) > 1 and np.any(stamps[1:] < stamps[:-1]):
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
    return int(stamps[0]), int(stamps[-1]), len(stamps), stamps.tobytes(), values.tobytes()
