"""The metric rows of a robot since a moment, for whoever goes on judging it; with the watermarks of the same moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import METRIC_STREAM
from gateway.store.engine import Row, StoreEngine, placeholders, slices, unsigned
from gateway.store.telemetry.chunks import TOGETHER, Stamps, Values, decode
from gateway.store.telemetry.series import WaitingRows, waiting_rows
from metaros.link import BACKFILL_BIT

__all__ = ["RecentRows", "read_recent"]

CHUNK_ROWS = 512  # what a chunk holds, about
EPOCHS = 16  # the newest of a robot's outboxes: no rows of older ones are under way
_MARKS = """
    SELECT stream_id, epoch, seq FROM streams JOIN robots USING (robot) WHERE id = ? AND stream_id IN (?, ?)
    ORDER BY updated_ns DESC LIMIT ?
"""
_CHUNKS = """
    SELECT c.chunk FROM metric_chunks c JOIN series s ON s.series = c.series JOIN robots r ON r.robot = s.robot
    WHERE r.id = ? AND c.last_ns >= ? AND c.first_ns <= ? ORDER BY c.last_ns DESC LIMIT ?
"""
_CONTENT = "SELECT series, encoding, count, stamps, vals FROM metric_chunks WHERE chunk IN ({})"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecentRows:
    """Rows by stamp; `index` points into `series`, which are (name, topic). `left_out` older ones were too many.

    `marks`, by stream and epoch: up to which number the robot's metric rows are committed.
    """

    marks: dict[tuple[int, int], int]
    series: tuple[tuple[str, str], ...]
    index: npt.NDArray[np.uint32]
    stamps: Stamps
    values: Values
    left_out: int = 0

    def __len__(self) -> int:
        return len(self.values)


def read_recent(engine: StoreEngine, robot: str, *, start_ns: int, end_ns: int, most: int) -> RecentRows:
    """The robot's newest rows between two stamps, both included, `most` at most; what is damaged is left out."""
    with engine.transaction(write=False):
        streams = METRIC_STREAM, METRIC_STREAM | BACKFILL_BIT
        marks = {(row[0], unsigned(row[1])): int(row[2]) for row in engine.fetch(_MARKS, robot, *streams, EPOCHS)}
        query = "SELECT series, name, topic FROM series JOIN robots USING (robot) WHERE id = ? ORDER BY series"
        named = engine.fetch(query, robot)
        chunks = engine.fetch(_CHUNKS, robot, start_ns, end_ns, most // CHUNK_ROWS + 4 * len(named))
        parts: list[WaitingRows] = []
        for some in slices([row[0] for row in chunks]):
            found = engine.fetch(_CONTENT.format(placeholders(len(some))), *some)
            parts += (_decoded(found[first : first + TOGETHER]) for first in range(0, len(found), TOGETHER))
        numbers, stamps, values = _joined([*parts, waiting_rows(engine, robot)])
    inside = (stamps >= start_ns) & (stamps <= end_ns)
    order = np.argsort(stamps[inside], kind="stable")
    rows = np.flatnonzero(inside)[order]
    left_out = max(0, len(rows) - most)
    rows = rows[left_out:]
    known = np.array([row[0] for row in named], np.uint32)  # sorted
    return RecentRows(
        marks=marks,
        series=tuple((row[1], row[2]) for row in named),
        index=np.searchsorted(known, numbers[rows]).astype(np.uint32),
        stamps=stamps[rows],
        values=values[rows],
        left_out=left_out,
    )


def _decoded(found: Sequence[Row]) -> WaitingRows:
    """Series, stamps and values of chunks; none of those that are damaged."""
    try:
        stamps, values = decode([(row[1], row[2], row[3], row[4]) for row in found])
    except ValueError:
        pieces = [_decoded([row]) for row in found] if len(found) > 1 else []
        return _joined(pieces)
    return np.repeat(np.array([row[0] for row in found], np.uint32), [row[2] for row in found]), stamps, values


def _joined(parts: Sequence[WaitingRows]) -> WaitingRows:
    empty = (np.empty(0, np.uint32), np.empty(0, np.int64), np.empty(0))
    numbers, stamps, values = (np.concatenate(column) for column in zip(empty, *parts, strict=True))
    return numbers, stamps, values
