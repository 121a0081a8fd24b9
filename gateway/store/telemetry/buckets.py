"""Downsampling of a series: buckets with their count, mean and extremes, or the few points that draw its line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from gateway.store.engine import Row
from gateway.store.telemetry.chunks import Stamps, Values
from gateway.store.telemetry.levels import Cells
from gateway.store.telemetry.lttb import extremes, lttb

__all__ = ["BucketDownsampler", "Columns", "Downsampler", "LineDownsampler", "Span"]

Counts = npt.NDArray[np.int64]
# stamp_ms, mean, min, max, count
Columns = tuple[npt.NDArray[np.float64], Values, Values, Values, Counts]
_CANDIDATES = 4  # for each point of a line; more do not make it better
_FEW = 32  # buckets whose number is kept to, however wide they are
_ALIGNED_NS = 10**9  # buckets of at least this width begin at multiples of it
_FAR_NS = 1 << 62  # there is no room beside stamps that are further from the epoch
_STEPS = 8  # a bucket is at least so many steps of the grid wide: fewer are less than a seventh fewer than asked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """What is asked: from one stamp to another, both included, in at most so many points."""

    start_ns: int
    end_ns: int
    points: int

    def width_ns(self, buckets: int) -> int:
        """How wide each of so many equal buckets is."""
        return max(1, -(-(self.end_ns - self.start_ns + 1) // buckets))

    def cut(self, stamps: Stamps, values: Values) -> tuple[Stamps, Values]:
        """The rows of the span whose value is a number, sorted by stamp; the same arrays when nothing is to be done."""
        if len(stamps) and (np.isnan(values).any() or stamps.min() < self.start_ns or stamps.max() > self.end_ns):
            keep = (stamps >= self.start_ns) & (stamps <= self.end_ns) & ~np.isnan(values)
            stamps, values = stamps[keep], values[keep]
        if np.any(stamps[1:] < stamps[:-1]):
            order = np.argsort(stamps, kind="stable")
            stamps, values = stamps[order], values[order]
        return stamps, values


class Downsampler(Protocol):
    """Takes summaries and rows of a span, piece by piece."""

    origin_ns: int  # a chunk that lies in one span of this width from here on may come as its summary
    width_ns: int
    count: int  # rows so far

    def add_summaries(self, rows: Sequence[Row]) -> None:
        """Take what chunks say of themselves."""

    def add(self, stamps: Stamps, values: Values) -> None:
        """Take rows of the span, sorted by stamp, without NaN."""

    def columns(self) -> Columns:
        """The result."""


class BucketDownsampler:
    """Equal buckets, at most as many as there are points; so is the memory.

    Where there are many and they are long, they begin at multiples of their width, and the width is one of `grid_ns`, a
    power of two: they stay where they are when the range moves on, and whole cells of levels make them up.
    """

    def __init__(self, span: Span) -> None:
        self.grid_ns = 0  # 0: they begin where the range does
        self.origin_ns, self.width_ns = span.start_ns, span.width_ns(span.points)
        near = span.start_ns > -_FAR_NS and span.end_ns < _FAR_NS
        if span.points >= _FEW and self.width_ns >= _ALIGNED_NS and near:
            least_ns = span.width_ns(span.points - 1)  # the first and the last are cut
            self.grid_ns = 1 << (least_ns // _STEPS).bit_length() - 1
            self.width_ns = -(-least_ns // self.grid_ns) * self.grid_ns
            self.origin_ns = span.start_ns // self.width_ns * self.width_ns
        self.count = 0
        self._span = span
        self._starts = self.origin_ns + np.arange(span.points, dtype=np.int64) * self.width_ns
        self._count = np.zeros(span.points, np.int64)
        self._total = np.zeros(span.points)
        self._low = np.full(span.points, np.inf)
        self._high = np.full(span.points, -np.inf)

    def add_summaries(self, rows: Sequence[Row]) -> None:
        """(bucket, count, low, high, total); each bucket once."""
        if rows:
            places, counts, *summaries = (np.array(column) for column in zip(*rows, strict=True))
            self._put(places.astype(np.int64), counts.astype(np.int64), *summaries)

    def add_cells(self, cells: Cells) -> None:
        """Count whole cells of the grid in."""
        if not len(cells.count):
            return
        places = (cells.begin_ns - self.origin_ns) // self.width_ns
        order = np.argsort(places, kind="stable")
        places, counts = places[order], cells.count[order]
        firsts = np.flatnonzero(np.diff(places, prepend=-1))
        with np.errstate(invalid="ignore", over="ignore"):
            totals = np.add.reduceat(cells.total[order], firsts)
        lows = np.minimum.reduceat(cells.low[order], firsts)
        highs = np.maximum.reduceat(cells.high[order], firsts)
        self._put(places[firsts], np.add.reduceat(counts, firsts), lows, highs, totals)

    def add(self, stamps: Stamps, values: Values) -> None:
        """Count some rows in."""
        if not len(stamps):
            return
        cuts = np.searchsorted(stamps, self._starts)
        counts = np.diff(cuts, append=len(stamps))
        places = np.flatnonzero(counts)
        firsts = cuts[places]
        with np.errstate(invalid="ignore", over="ignore"):
            totals = np.add.reduceat(values, firsts)
        lows, highs = np.minimum.reduceat(values, firsts), np.maximum.reduceat(values, firsts)
        self._put(places, counts[places], lows, highs, totals)

    def columns(self) -> Columns:
        """The buckets that hold any row, each stamped in the middle of what the range has of it."""
        full = np.flatnonzero(self._count)
        starts = self._starts[full]
        middle_ns = starts + self.width_ns // 2
        if self.grid_ns:
            begin_ns = np.maximum(starts, self._span.start_ns)
            middle_ns = begin_ns + (np.minimum(starts + self.width_ns, self._span.end_ns + 1) - begin_ns) // 2
        middle_ms = middle_ns / 1e6
        with np.errstate(invalid="ignore", over="ignore"):
            mean = self._total[full] / self._count[full]
        return middle_ms, mean, self._low[full], self._high[full], self._count[full]

    def _put(self, places: Counts, counts: Counts, lows: Values, highs: Values, totals: Values) -> None:
        self.count += int(counts.sum())
        self._count[places] += counts
        with np.errstate(invalid="ignore", over="ignore"):
            self._total[places] += totals
        self._low[places] = np.minimum(self._low[places], lows)
        self._high[places] = np.maximum(self._high[places], highs)


class LineDownsampler:
    """The points of a span that draw its line: all rows while they are few, else extremes of short spans, then LTTB."""

    def __init__(self, span: Span) -> None:
        self._span = span
        self.origin_ns = span.start_ns
        self.width_ns = span.width_ns(max(1, span.points * _CANDIDATES // 2))
        self.count = 0
        self._stamps: list[Stamps] = []
        self._values: list[Values] = []

    def add_summaries(self, rows: Sequence[Row]) -> None:
        """(anything, count, low, high, stamp of low, stamp of high) of each chunk."""
        if rows:
            _, counts, low, high, low_ns, high_ns = zip(*rows, strict=True)
            self.count += sum(counts)
            lows, highs = np.array(low_ns, np.int64), np.array(high_ns, np.int64)
            two = lows != highs
            self._stamps += [lows, highs[two]]
            self._values += [np.array(low, np.float64), np.array(high, np.float64)[two]]

    def add(self, stamps: Stamps, values: Values) -> None:
        """Keep some rows, or their extremes."""
        self.count += len(stamps)
        if len(stamps) > self._span.points * _CANDIDATES:
            owner = (stamps - self._span.start_ns) // self.width_ns
            kept = extremes(values, np.flatnonzero(np.diff(owner, prepend=-1)))
            stamps, values = stamps[kept], values[kept]
        self._stamps.append(stamps)
        self._values.append(values)

    def columns(self) -> Columns:
        """At most as many rows as were asked for."""
        stamps = np.concatenate(self._stamps) if self._stamps else np.empty(0, np.int64)
        values = np.concatenate(self._values) if self._values else np.empty(0)
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
        kept = lttb((stamps - self._span.start_ns).astype(np.float64), values, self._span.points)
        values = values[kept]
        return stamps[kept] / 1e6, values, values, values, np.ones(len(kept), np.int64)
