"""Reading a series between two stamps, as rows, buckets or a line of few points; its declared losses beside it.

Long ranges are made of levels, whose cells make up wide buckets. Where another chunk of rows lies as a whole in one
bucket its summary is enough, and summaries are added up by the database; only chunks across the edge of a bucket are
read and cut. What comes is exact all the same. Chunks are read a slice at a time, so that a query's memory does not
grow with its range.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import METRIC_STREAM
from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, placeholders, slices
from gateway.store.telemetry.buckets import BucketDownsampler, Downsampler, LineDownsampler, Span
from gateway.store.telemetry.chunks import TOGETHER, Stamps, Values, decode
from gateway.store.telemetry.levels import read_levels
from metaros.link import BACKFILL_BIT

__all__ = ["DAMAGED", "Method", "SeriesRange", "WaitingRows", "read_metric_gaps", "read_range", "waiting_rows"]

DAMAGED = "damaged"
Method = Literal["buckets", "lttb"]
WaitingRows = tuple[npt.NDArray[np.uint32], Stamps, Values]

_INSIDE = """
    first_ns >= ? AND last_ns <= ? AND total IS NOT NULL AND (first_ns - ?) / ? = (last_ns - ?) / ?
"""  # in one bucket
_TOUCHING = "FROM metric_chunks WHERE series = ? AND last_ns >= ? AND first_ns <= ? AND coalesce(valid, 1) > 0"
# The same of some numbers, by which they are found: the signs keep both databases from looking through all times.
_NUMBERED = f"{_TOUCHING.replace('last_ns', '+last_ns').replace('first_ns', '+first_ns')} AND chunk BETWEEN ? AND ?"
_SUMMARIES = f"""
    SELECT place, sum(valid), min(low), max(high), sum(total) FROM (
        SELECT CASE WHEN {_INSIDE} THEN (first_ns - ?) / ? ELSE -chunk END AS place,
            CAST(valid AS INTEGER) AS valid, low, high, total {{}}
    ) AS spans GROUP BY place
"""
_EXTREMES = f"""
    SELECT CASE WHEN {_INSIDE} THEN 0 ELSE -chunk END, valid, low, high, low_ns, high_ns {_TOUCHING}
"""
_END = 1 << 62  # no chunk has this number
_GAPS = """
    SELECT from_seq, to_seq, reason, from_ns, to_ns FROM gaps JOIN robots USING (robot)
    WHERE id = ? AND stream_id IN (?, ?) AND to_ns >= ? AND from_ns <= ? ORDER BY to_ns DESC, from_seq DESC LIMIT ?
"""


@dataclass(frozen=True, slots=True)
class SeriesRange:
    """A piece of one series: rows as they are (count 1) or buckets with mean, min, max and count.

    `damaged` names rows that are stored but cannot be read: first and last stamp, and how many.
    """

    name: str
    stamp_ms: npt.NDArray[np.float64]
    mean: Values
    min: Values
    max: Values
    count: npt.NDArray[np.int64]
    damaged: list[tuple[int, int, int]] = field(default_factory=list)


def read_range(
    engine: StoreEngine,
    robot_id: str,
    names: Sequence[str],
    *,
    start_ns: int,
    end_ns: int,
    points: int,
    method: Method = "buckets",
) -> list[SeriesRange]:
    """Each named series between two stamps, both included; a name nobody stored gives an empty range."""
    span = Span(start_ns=start_ns, end_ns=end_ns, points=points)
    with engine.transaction(write=False):
        waiting = waiting_rows(engine, robot_id)
        ranges = []
        for name in names:
            downsampler: BucketDownsampler | LineDownsampler = (
                LineDownsampler(span) if method == "lttb" else BucketDownsampler(span)
            )
            find = "SELECT series FROM series JOIN robots USING (robot) WHERE id = ? AND name = ?"
            damaged: list[tuple[int, int, int]] = []
            for row in engine.fetch(find, robot_id, name):
                reading = _Reading(engine, int(row[0]), span, waiting, damaged)
                reading.fill(downsampler)
                if downsampler.count <= points:
                    downsampler = LineDownsampler(span)  # few enough to give them all
                    reading.fill_all(downsampler)
            ranges.append(SeriesRange(name, *downsampler.columns(), damaged))
        return ranges


def read_metric_gaps(engine: StoreEngine, robot_id: str, *, start_ns: int, end_ns: int, limit: int) -> list[Gap]:
    """The robot's declared losses of metric rows that touch the time between two stamps, at most the newest `limit`.

    In order of time.
    """
    streams = METRIC_STREAM, METRIC_STREAM | BACKFILL_BIT
    with engine.transaction(write=False):
        rows = engine.fetch(_GAPS, robot_id, *streams, start_ns, end_ns, limit)
    return [Gap(*row) for row in reversed(rows)]


def waiting_rows(engine: StoreEngine, robot_id: str) -> WaitingRows:
    """The robot's rows (series, stamp, value) that the merge has not moved yet, in the order they came."""
    query = (
        "SELECT series, stamps, vals FROM metric_batches"
        " WHERE robot = (SELECT robot FROM robots WHERE id = ?) ORDER BY batch"
    )
    rows = engine.fetch(query, robot_id)
    series, stamps, values = (b"".join(row[column] for row in rows) for column in range(3))
    return np.frombuffer(series, np.uint32), np.frombuffer(stamps, np.int64), np.frombuffer(values, np.float64)


@dataclass(frozen=True, slots=True)
class _Reading:
    """One series on one snapshot."""

    engine: StoreEngine
    series: int
    span: Span
    waiting: WaitingRows
    damaged: list[tuple[int, int, int]]

    def fill(self, downsampler: BucketDownsampler | LineDownsampler) -> None:
        """Everything of the range, by levels and summaries where they are enough."""
        origin_ns, width_ns = downsampler.origin_ns, downsampler.width_ns
        inside = (self.span.start_ns, self.span.end_ns, origin_ns, width_ns, origin_ns, width_ns)
        touching = (self.series, self.span.start_ns, self.span.end_ns)
        if isinstance(downsampler, LineDownsampler):
            found = [self.engine.fetch(_EXTREMES, *inside, *touching)]
        elif (numbers := self._fill_cells(downsampler)) is None:
            found = [self.engine.fetch(_SUMMARIES.format(_TOUCHING), *inside, origin_ns, width_ns, *touching)]
        else:
            query = _SUMMARIES.format(_NUMBERED)
            found = [self.engine.fetch(query, *inside, origin_ns, width_ns, *touching, *some) for some in numbers]
        for rows in found:
            downsampler.add_summaries([row for row in rows if row[0] >= 0])
        self._fill_rows(downsampler, sorted(-row[0] for rows in found for row in rows if row[0] < 0))

    def _fill_cells(self, downsampler: BucketDownsampler) -> list[tuple[int, int]] | None:
        """What levels hold of the range; between which numbers its other chunks lie. None: levels hold nothing."""
        span, grid_ns = self.span, downsampler.grid_ns
        if not grid_ns:
            return None
        cells, held = read_levels(self.engine, self.series, start_ns=span.start_ns, end_ns=span.end_ns, grid_ns=grid_ns)
        downsampler.add_cells(cells)
        if not held:
            return None
        firsts, lasts = zip(*sorted(held), strict=True)
        between = zip((0, *lasts), (*firsts, _END), strict=True)
        return [(last + 1, first - 1) for last, first in between if last + 1 < first]

    def fill_all(self, downsampler: Downsampler) -> None:
        """Every row of the range."""
        self.damaged.clear()
        numbers = self.engine.fetch(f"SELECT chunk {_TOUCHING}", self.series, self.span.start_ns, self.span.end_ns)
        self._fill_rows(downsampler, sorted(row[0] for row in numbers))

    def _fill_rows(self, downsampler: Downsampler, chunks: Sequence[int]) -> None:
        for stamps, values in self._rows(chunks):
            downsampler.add(*self.span.cut(stamps, values))
        mine = self.waiting[0] == self.series
        downsampler.add(*self.span.cut(self.waiting[1][mine], self.waiting[2][mine]))

    def _rows(self, chunks: Sequence[int]) -> Iterator[tuple[Stamps, Values]]:
        """The database reads the next slice while this one is decoded: each takes about as long."""
        pieces = slices(chunks)
        with ThreadPoolExecutor(1, thread_name_prefix="gateway-series") as ahead:
            coming = [ahead.submit(self._fetch, some) for some in islice(pieces, 1)]
            while coming:
                found = coming.pop().result()
                coming = [ahead.submit(self._fetch, some) for some in islice(pieces, 1)]
                yield from self._decoded(found)

    def _fetch(self, chunks: Sequence[int]) -> Sequence[Row]:
        query = (
            "SELECT encoding, count, stamps, vals, first_ns, last_ns FROM metric_chunks"
            f" WHERE chunk IN ({placeholders(len(chunks))}) ORDER BY last_ns"
        )
        return self.engine.fetch(query, *chunks)

    def _decoded(self, found: Sequence[Row]) -> Iterator[tuple[Stamps, Values]]:
        for first in range(0, len(found), TOGETHER):
            rows = found[first : first + TOGETHER]
            try:
                yield decode([(row[0], row[1], row[2], row[3]) for row in rows])
            except ValueError:
                yield from self._undamaged(rows)

    def _undamaged(self, rows: Sequence[Row]) -> Iterator[tuple[Stamps, Values]]:
        for row in rows:
            try:
                yield decode([(row[0], row[1], row[2], row[3])])
            except ValueError:
                self.damaged.append((row[4], row[5], row[1]))
