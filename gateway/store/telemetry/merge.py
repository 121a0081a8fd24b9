"""The background merge: metric batches, as they came, become chunks of about 500 samples a series.

One step is one transaction: the rows enter their chunks and the batches leave, or neither. A reader's snapshot
therefore sees every row exactly once, before, during and after.
"""

from __future__ import annotations

import logging
from dataclasses import fields
from typing import Any

import numpy as np

from gateway.store.engine import StoreEngine, placeholders
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.telemetry.chunks import EncodedChunk, Stamps, Values, decode, encode

__all__ = ["merge_step", "waiting_batches"]

log = logging.getLogger(__name__)
_COLUMNS = tuple(item.name for item in fields(EncodedChunk))
_OPEN = f"""
    SELECT chunk, encoding, count, stamps, vals FROM metric_chunks WHERE series = ? AND count < {CHUNK_SAMPLES}
    ORDER BY chunk DESC LIMIT 1
"""
_UPDATE = f"UPDATE metric_chunks SET {', '.join(f'{name} = ?' for name in _COLUMNS)}, stored_ns = ? WHERE chunk = ?"
_INSERT = (
    f"INSERT INTO metric_chunks ({', '.join(_COLUMNS)}, stored_ns, series) VALUES ({placeholders(len(_COLUMNS) + 2)})"
)


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
    for number, *chunk in engine.fetch(_OPEN + engine.for_update, series):
        try:
            held = decode([tuple(chunk)])
        except ValueError as error:
            # Left as it is, for the integrity check to name: it must not keep the store from taking rows.
            log.error("chunk %d of series %d cannot be read: %s", number, series, error)
            continue
        taken = min(len(stamps), CHUNK_SAMPLES - len(held[0]))
        joined = np.concatenate((held[0], stamps[:taken])), np.concatenate((held[1], values[:taken]))
        engine.execute(_UPDATE, *_columns(*joined), stored_ns, number)
        stamps, values = stamps[taken:], values[taken:]
        break
    pieces = [slice(start, start + CHUNK_SAMPLES) for start in range(0, len(stamps), CHUNK_SAMPLES)]
    engine.many(_INSERT, [(*_columns(stamps[piece], values[piece]), stored_ns, series) for piece in pieces])


def _columns(stamps: Stamps, values: Values) -> tuple[Any, ...]:
    chunk = encode(stamps, values, closed=len(stamps) == CHUNK_SAMPLES)
    return tuple(getattr(chunk, name) for name in _COLUMNS)
