"""The background merge: metric batches, as they came, become chunks of about 500 samples a series.

A step is planned on any snapshot, which is most of the work, and done in one transaction, which finds what it was
planned for as it was, or does nothing: the rows enter their chunks and the batches leave, or neither. A reader's
snapshot therefore sees every row exactly once, before, during and after.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter

import numpy as np
import numpy.typing as npt

from gateway.domain.distinct import distinct
from gateway.store.engine import Row, StoreEngine, placeholders, slices
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.telemetry.chunks import TOGETHER, EncodedChunk, Stamps, Values, decode
from gateway.store.telemetry.encode import encode_many

__all__ = ["Merge", "do_merge", "merge_step", "plan_merge", "waiting_batches"]

log = logging.getLogger(__name__)
_Numbers = npt.NDArray[np.int64]
_COLUMNS = tuple(item.name for item in fields(EncodedChunk))
_OPEN = f"""
    SELECT series, chunk, encoding, count, stamps, vals FROM metric_chunks
    WHERE series IN ({{}}) AND count < {CHUNK_SAMPLES} ORDER BY chunk
"""
_UPDATE = f"UPDATE metric_chunks SET {', '.join(f'{name} = ?' for name in _COLUMNS)}, stored_ns = ? WHERE chunk = ?"
_INSERT = (
    f"INSERT INTO metric_chunks ({', '.join(_COLUMNS)}, stored_ns, series) VALUES ({placeholders(len(_COLUMNS) + 2)})"
)
_row_of = attrgetter(*_COLUMNS)


def waiting_batches(engine: StoreEngine) -> tuple[int, int]:
    """(how many batches wait for the merge, when the oldest of them was stored); the time is 0 when none waits."""
    with engine.transaction(write=False):
        count = engine.fetch("SELECT count(*) FROM metric_batches")[0][0]
        oldest = engine.fetch("SELECT stored_ns FROM metric_batches ORDER BY batch LIMIT 1")
    return int(count), int(oldest[0][0]) if oldest else 0


@dataclass(frozen=True, slots=True)
class Merge:
    """What a step is to do: which batches go, which open chunks (with so many rows) are filled, and the new rows."""

    batches: Sequence[int]
    filled: dict[int, int]
    updated: Sequence[Row]
    inserted: Sequence[Row]


def merge_step(engine: StoreEngine, *, max_batches: int) -> int:
    """Move the rows of at most `max_batches` batches into chunks; returns how many batches went."""
    with engine.transaction(write=True):
        return do_merge(engine, plan_merge(engine, max_batches=max_batches))


def do_merge(engine: StoreEngine, merge: Merge) -> int:
    """Do it, inside a writing transaction; how many batches went: none where somebody touched them meanwhile."""
    there: set[int] = set()
    for some in slices(merge.batches):
        query = f"SELECT batch FROM metric_batches WHERE batch IN ({placeholders(len(some))}) ORDER BY batch"
        there.update(row[0] for row in engine.fetch(query + engine.for_update, *some))
    open_now: dict[int, int] = {}
    for some in slices(list(merge.filled)):
        query = f"SELECT chunk, count FROM metric_chunks WHERE chunk IN ({placeholders(len(some))}) ORDER BY chunk"
        open_now.update((row[0], row[1]) for row in engine.fetch(query + engine.for_update, *some))
    if len(there) != len(merge.batches) or open_now != merge.filled:
        return 0
    engine.many(_UPDATE, merge.updated)
    engine.many(_INSERT, merge.inserted)
    engine.many("DELETE FROM metric_batches WHERE batch = ?", [(batch,) for batch in merge.batches])
    return len(merge.batches)


@dataclass(frozen=True, slots=True)
class _Open:
    """The open chunks of some series, by the place of their series, and their rows one after the other."""

    chunks: dict[int, int]
    counts: Sequence[int]
    places: _Numbers  # of each row
    stamps: Stamps
    values: Values


def plan_merge(engine: StoreEngine, *, max_batches: int) -> Merge:
    """What to do with the oldest batches, inside a transaction; nothing where there are none."""
    query = "SELECT batch, stored_ns, series, stamps, vals FROM metric_batches ORDER BY batch LIMIT ?"
    batches = engine.fetch(query + engine.for_update, max_batches)
    if not batches:
        return Merge((), {}, (), ())
    series, places = distinct(np.frombuffer(b"".join(batch[2] for batch in batches), np.uint32))
    held = _read_open(engine, series)
    places = np.concatenate((held.places.astype(places.dtype), places))
    stamps = np.concatenate((held.stamps, np.frombuffer(b"".join(batch[3] for batch in batches), np.int64)))
    values = np.concatenate((held.values, np.frombuffer(b"".join(batch[4] for batch in batches), np.float64)))
    order = np.argsort(places, kind="stable")
    stamps, values = stamps[order], values[order]
    stored_ns = max(batch[1] for batch in batches)
    inserted, updated = [], []
    for length, owners, starts, firsts in _pieces(np.bincount(places, minlength=len(series))):
        rows = starts[:, None] + np.arange(length)
        chunks = encode_many(stamps[rows], values[rows], closed=length == CHUNK_SAMPLES)
        for chunk, owner, first in zip(chunks, owners.tolist(), firsts.tolist(), strict=True):
            if first and owner in held.chunks:
                updated.append((*_row_of(chunk), stored_ns, held.chunks[owner]))
            else:
                inserted.append((*_row_of(chunk), stored_ns, series[owner]))
    filled = dict(zip(held.chunks.values(), held.counts, strict=True))
    return Merge([batch[0] for batch in batches], filled, updated, inserted)


def _read_open(engine: StoreEngine, series: Sequence[int]) -> _Open:
    """The newest open chunk of each series, as far as it can be read."""
    places = {number: place for place, number in enumerate(series)}
    newest: dict[int, Row] = {}
    for some in slices(series):
        found = engine.fetch(_OPEN.format(placeholders(len(some))) + engine.for_update, *some)
        newest.update((places[row[0]], row[1:]) for row in found)
    chunks: dict[int, int] = {}
    stamps: list[Stamps] = [np.empty(0, np.int64)]
    values: list[Values] = [np.empty(0)]
    counts: list[int] = []
    for place, rows in _decoded(newest):
        chunks[place] = newest[place][0]
        counts.append(len(rows[0]))
        stamps.append(rows[0])
        values.append(rows[1])
    owners = np.repeat(np.fromiter(chunks, np.int64, len(chunks)), counts)
    return _Open(chunks, counts, owners, np.concatenate(stamps), np.concatenate(values))


def _decoded(chunks: dict[int, Row]) -> Iterator[tuple[int, tuple[Stamps, Values]]]:
    """The rows of chunks (number, encoding, count, stamps, vals), by the key of each.

    One that cannot be read is left as it is, for the integrity check to name: it must not keep the store from taking
    rows.
    """
    keys = list(chunks)
    for first in range(0, len(keys), TOGETHER):
        some = keys[first : first + TOGETHER]
        try:
            stamps, values = decode([tuple(chunks[key][1:]) for key in some])
        except ValueError as error:
            if len(some) > 1:
                for key in some:
                    yield from _decoded({key: chunks[key]})
            else:
                log.error("chunk %d cannot be read: %s", chunks[some[0]][0], error)
            continue
        ends = np.cumsum([chunks[key][2] for key in some])[:-1]
        yield from zip(some, zip(np.split(stamps, ends), np.split(values, ends), strict=True), strict=True)


def _pieces(counts: _Numbers) -> Iterator[tuple[int, _Numbers, _Numbers, npt.NDArray[np.bool_]]]:
    """How rows in the order of their series, of which each has so many, are cut into chunks of one length.

    Gives (length, the place of each chunk's series, where each begins, which of them is the first of its series).
    """
    starts, full, rest = np.cumsum(counts) - counts, counts // CHUNK_SAMPLES, counts % CHUNK_SAMPLES
    owners = np.repeat(np.arange(len(counts)), full)
    within = np.arange(len(owners)) - np.repeat(np.cumsum(full) - full, full)
    groups = [(CHUNK_SAMPLES, owners, starts[owners] + within * CHUNK_SAMPLES, within == 0)]
    for length in np.unique(rest[rest > 0]).tolist():
        (owners,) = np.nonzero(rest == length)
        groups.append((length, owners, starts[owners] + full[owners] * CHUNK_SAMPLES, full[owners] == 0))
    for length, *columns in groups:
        for first in range(0, len(columns[0]), TOGETHER):
            owners, begins, firsts = (column[first : first + TOGETHER] for column in columns)
            yield length, owners, begins, firsts
