"""Levels: what 64 chunks of a series hold in each cell of a time grid, so that a long range is read without its rows.

A cell has the count, the extremes and the sum of the values that are numbers. Cells are 2^n nanoseconds wide and begin
at multiples of that, so that every span that does, too, is made of whole cells, and what is added up is exact. A level
is made once, behind the writes, of chunks that are full and therefore never change; with the first of its chunks that
leaves by age it goes. It is nothing but a short cut: what no level holds is read from the chunks.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.store.engine import Row, StoreEngine, placeholders, slices
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.telemetry.chunks import Stamps, Values, decode

__all__ = ["LEVEL_CHUNKS", "Cells", "LevelBuilder", "cells_of", "drop_levels", "read_levels", "series_of"]

LEVEL_CHUNKS = 64
SETTLED_NS = 600 * 10**9  # younger chunks are left alone: at another gateway one of a lower number may be on its way
_CELLS = 128  # of a level, at most
_SERIES = 500  # looked at in one step
_RANGES = 16  # of chunk numbers in one query
_CELL = np.dtype([("place", "<u2"), ("count", "<u4"), ("low", "<f8"), ("high", "<f8"), ("total", "<f8")])

_DUE = f"""
    SELECT series, done FROM (
        SELECT series, coalesce((SELECT max(last_chunk) FROM metric_levels l WHERE l.series = s.series), 0) AS done
        FROM series s WHERE series > ? AND series <= ?
    ) AS asked WHERE {LEVEL_CHUNKS} = (SELECT count(*) FROM (
        SELECT 1 FROM metric_chunks c WHERE c.series = asked.series AND chunk > done
        AND count >= {CHUNK_SAMPLES} AND stored_ns <= ? LIMIT {LEVEL_CHUNKS}
    ) AS waiting)
"""
_NEXT = f"""
    SELECT encoding, count, stamps, vals, chunk, stored_ns, first_ns, last_ns FROM metric_chunks
    WHERE series = ? AND chunk > ? ORDER BY chunk LIMIT {LEVEL_CHUNKS}
"""
_INSERT = f"INSERT INTO metric_levels VALUES ({placeholders(8)}) ON CONFLICT (series, first_chunk) DO NOTHING"
_READ = """
    SELECT first_chunk, last_chunk, behind_chunk, first_ns, shift, cells FROM metric_levels
    WHERE series = ? AND last_ns BETWEEN ? AND ? AND first_ns >= ? AND shift <= ? ORDER BY first_chunk
"""


@dataclass(frozen=True, slots=True)
class Cells:
    """Some cells, each with when it begins and what is in it; in no order, and one time may be there twice."""

    begin_ns: Stamps
    count: npt.NDArray[np.int64]
    low: Values
    high: Values
    total: Values


class LevelBuilder:
    """One round over all series, a step at a time: each is a transaction, and takes some milliseconds."""

    def __init__(self, engine: StoreEngine, *, now_ns: int) -> None:
        self._engine = engine
        self._settled_ns = now_ns - SETTLED_NS
        self._seen = 0  # series up to this number were looked at
        self._due: list[tuple[int, int]] = []  # series, and the last chunk that it has a level of

    def step(self) -> bool:
        """Make a level, or look at some series; False when the round is over."""
        with self._engine.transaction(write=True):
            if self._due:
                self._make(*self._due.pop())
                return True
            last = self._engine.fetch("SELECT max(series) FROM series")[0][0]
            if last is None or self._seen >= last:
                return False
            found = self._engine.fetch(_DUE, self._seen, self._seen + _SERIES, self._settled_ns)
            self._due = [(int(series), int(done)) for series, done in found]
            self._seen += _SERIES
            return True

    def _make(self, series: int, done: int) -> None:
        """The series' next level, where its next chunks are all full; perhaps there is one more behind it."""
        rows = self._engine.fetch(_NEXT + self._engine.for_update, series, done)
        if len(rows) < LEVEL_CHUNKS or any(row[1] < CHUNK_SAMPLES or row[5] > self._settled_ns for row in rows):
            return
        shift, cells = None, b""
        with contextlib.suppress(ValueError):  # damaged: who reads the chunks is told, and the integrity check names it
            shift, cells = cells_of(*decode([(row[0], row[1], row[2], row[3]) for row in rows]))
        last = int(rows[-1][4])
        span_ns = min(row[6] for row in rows), max(row[7] for row in rows)
        self._engine.execute(_INSERT, series, rows[0][4], last, done, *span_ns, shift, cells)
        self._due.append((series, last))


def cells_of(stamps: Stamps, values: Values) -> tuple[int, bytes]:
    """The cells of some rows, at least one: the power of two that they are wide, and the cells as they are stored."""
    first_ns, last_ns = int(stamps.min()), int(stamps.max())
    shift = ((last_ns - first_ns) // (_CELLS - 1)).bit_length()  # so that they lie in _CELLS at most
    held = ~np.isnan(values)
    places, values = (stamps[held] >> shift) - (first_ns >> shift), values[held]
    if np.any(places[1:] < places[:-1]):
        order = np.argsort(places, kind="stable")
        places, values = places[order], values[order]
    starts = np.flatnonzero(np.diff(places, prepend=-1))
    cells = np.empty(len(starts), _CELL)
    if len(starts):
        cells["place"], cells["count"] = places[starts], np.diff(starts, append=len(places))
        cells["low"], cells["high"] = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        with np.errstate(invalid="ignore", over="ignore"):
            cells["total"] = np.add.reduceat(values, starts)
    return shift, cells.tobytes()


def read_levels(
    engine: StoreEngine, series: int, *, start_ns: int, end_ns: int, grid_ns: int
) -> tuple[Cells, list[tuple[int, int]]]:
    """What levels hold of a series between two stamps, both included, in cells no wider than `grid_ns`, a power of two.

    And between which numbers the chunks lie that need not be asked therefore. Inside a transaction of the caller's.
    """
    runs: list[list[Row]] = []  # of levels without a chunk between them
    for row in engine.fetch(_READ, series, start_ns, end_ns, start_ns, grid_ns.bit_length() - 1):
        last = runs[-1][-1] if runs else None
        if last is not None and row[0] <= last[1]:
            continue  # another gateway made one of the same chunks meanwhile
        if last is not None and row[2] == last[1]:
            runs[-1].append(row)
        else:
            runs.append([row])
    runs = sorted(runs, key=len, reverse=True)[:_RANGES]
    return _joined([row for run in runs for row in run]), [(run[0][0], run[-1][1]) for run in runs]


def _joined(rows: Sequence[Row]) -> Cells:
    found = np.frombuffer(b"".join(row[5] for row in rows), _CELL)
    counts = [len(row[5]) // _CELL.itemsize for row in rows]
    shifts = np.repeat(np.array([row[4] for row in rows], np.int64), counts)
    bases = np.repeat(np.array([row[3] >> row[4] for row in rows], np.int64), counts)
    begin_ns = (bases + found["place"]) << shifts
    return Cells(begin_ns, found["count"].astype(np.int64), found["low"], found["high"], found["total"])


def series_of(engine: StoreEngine, chunks: Sequence[int]) -> list[tuple[int, int]]:
    """(series, chunk) of some chunks; inside a transaction of the caller's."""
    found: list[tuple[int, int]] = []
    for some in slices(chunks):
        query = f"SELECT series, chunk FROM metric_chunks WHERE chunk IN ({placeholders(len(some))})"
        found += [(int(row[0]), int(row[1])) for row in engine.fetch(query, *some)]
    return found


def drop_levels(engine: StoreEngine, chunks: Sequence[tuple[int, int]]) -> None:
    """Forget the levels of chunks, given as (series, chunk), that are no more; inside their transaction, after them."""
    engine.many(
        "DELETE FROM metric_levels WHERE series = ? AND first_chunk <= ? AND last_chunk >= ?",
        [(series, chunk, chunk) for series, chunk in chunks],
    )
