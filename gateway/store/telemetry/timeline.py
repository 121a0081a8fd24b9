"""Density of stored data over time: counts by bucket, from the rows' first and last stamps alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.store.engine import Row, StoreEngine

__all__ = ["Density", "read_density", "series_count"]

Counts = npt.NDArray[np.int64]
# A batch, a segment's run and a chunk of a series count alike: so many samples between two stamps.
_SPANS = """
    SELECT (first_ns - ?) / ?, (last_ns - ?) / ?, CAST(sum(count) AS BIGINT) FROM {table}
    WHERE {owner} IN (SELECT {owner} FROM {owners} WHERE robot = ?) AND last_ns >= ? AND first_ns < ? GROUP BY 1, 2
"""
_MESSAGES = tuple(
    _SPANS.format(table=table, owner="channel", owners="channels") for table in ("sample_batches", "segment_runs")
)
_ROWS = _SPANS.format(table="metric_chunks", owner="series", owners="series")
_WAITING = "SELECT stamps FROM metric_batches WHERE robot = ?"


@dataclass(frozen=True, slots=True)
class Density:
    """Messages and metric rows by bucket; bucket n begins at start + n × `width_ns`."""

    width_ns: int
    messages: Counts
    rows: Counts


def read_density(engine: StoreEngine, robot_id: str, *, start_ns: int, end_ns: int, buckets: int) -> Density:
    """Counts from one stamp up to another. Samples of a row are taken as evenly spread over its time."""
    width_ns = max(1, -(-(end_ns - start_ns) // buckets))
    with engine.transaction(write=False):
        found = engine.fetch("SELECT robot FROM robots WHERE id = ?", robot_id)
        robot = int(found[0][0]) if found else -1
        values = (start_ns, width_ns, start_ns, width_ns, robot, start_ns, end_ns)
        messages = [row for query in _MESSAGES for row in engine.fetch(query, *values)]
        rows = list(engine.fetch(_ROWS, *values))
        waiting = engine.fetch(_WAITING, robot)
    stamps = np.frombuffer(b"".join(bytes(row[0]) for row in waiting), np.int64)
    stamps = stamps[(stamps >= start_ns) & (stamps < end_ns)]
    fresh = np.bincount((stamps - start_ns) // width_ns, minlength=buckets).astype(np.int64)
    return Density(width_ns, _spread(messages, buckets), _spread(rows, buckets) + fresh)


def series_count(engine: StoreEngine, robot_id: str) -> int:
    """How many series the robot ever sent."""
    with engine.transaction(write=False):
        rows = engine.fetch("SELECT count(*) FROM series JOIN robots USING (robot) WHERE id = ?", robot_id)
    return int(rows[0][0])


def _spread(spans: Sequence[Row], buckets: int) -> Counts:
    """Spans (first bucket, last bucket, count) as counts by bucket; their sum is kept where they lie inside."""
    if not spans:
        return np.zeros(buckets, np.int64)
    first, last, count = np.array([tuple(map(int, span)) for span in spans], np.int64).T
    share = count / (last - first + 1)
    steps = np.zeros(buckets + 1)
    np.add.at(steps, np.clip(first, 0, buckets), share)
    np.add.at(steps, np.clip(last + 1, 0, buckets), -share)
    ends = np.rint(np.cumsum(np.cumsum(steps[:buckets])))
    return np.diff(ends, prepend=0.0).astype(np.int64)
