"""Checks that every sample of a stream is stored once or declared lost, up to the watermark.

Of each stream the numbers of its samples and of its declared losses must follow each other without a hole and without
meeting twice, from the first sample that is still kept up to the watermark. Before that first sample the retention may
have deleted anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from gateway.store.engine import StoreEngine

__all__ = ["Fault", "Interval", "audit", "stream_faults"]

_INTERVALS = """
    SELECT stream_id, epoch, first_seq, first_seq + count - 1, first_ns, last_ns, channel FROM sample_batches
    WHERE robot = ?
    UNION ALL SELECT stream_id, epoch, first_seq, first_seq + count - 1, first_ns, last_ns, channel FROM segment_runs
    WHERE robot = ?
    UNION ALL SELECT stream_id, epoch, from_seq, to_seq, from_ns, to_ns, NULL FROM gaps WHERE robot = ?
    ORDER BY 1, 2, 3, 4
"""


class Interval(NamedTuple):
    """Numbers that follow each other: samples of a channel, or a declared loss, whose channel is None."""

    first_seq: int
    last_seq: int
    first_ns: int
    last_ns: int
    channel: int | None


class Fault(NamedTuple):
    """Numbers that are stored nowhere ('hole'), twice ('twice'), or past the watermark ('ahead')."""

    what: str
    first_seq: int
    last_seq: int
    first_ns: int
    last_ns: int
    channel: int


def audit(intervals: Iterable[Interval], watermark: int) -> Iterator[Fault]:
    """The faults of one stream; its intervals come by their first number."""
    before: Interval | None = None  # the one that reaches furthest so far
    channel: int | None = None
    for interval in intervals:
        if before is not None and interval.first_seq <= before.last_seq:
            about = channel if channel is not None else interval.channel
            if about is not None:  # two losses declared over each other lose nothing
                last_seq = min(before.last_seq, interval.last_seq)
                yield Fault("twice", interval.first_seq, last_seq, interval.first_ns, interval.last_ns, about)
        elif before is not None and channel is not None and interval.first_seq > before.last_seq + 1:
            yield Fault("hole", before.last_seq + 1, interval.first_seq - 1, before.last_ns, interval.first_ns, channel)
        if interval.channel is not None:
            channel = interval.channel
        if before is None or interval.last_seq > before.last_seq:
            before = interval
    if before is None or channel is None:
        return
    if before.last_seq < watermark:
        yield Fault("hole", before.last_seq + 1, watermark, before.last_ns, before.last_ns, channel)
    elif before.last_seq > watermark:
        yield Fault("ahead", watermark + 1, before.last_seq, before.first_ns, before.last_ns, channel)


def stream_faults(engine: StoreEngine, robot: int) -> tuple[int, list[Fault]]:
    """How many streams of a robot (its number) have samples or losses, and what is wrong with them; of one moment."""
    with engine.transaction(write=False):
        rows = engine.fetch(_INTERVALS, robot, robot, robot)
        marks = engine.fetch("SELECT stream_id, epoch, seq FROM streams WHERE robot = ?", robot)
    watermarks = {(row[0], row[1]): int(row[2]) for row in marks}
    faults: list[Fault] = []
    count = 0
    for stream, some in groupby(rows, key=_stream):
        count += 1
        faults += audit((Interval(*row[2:]) for row in some), watermarks.get(stream, 0))
    return count, faults


def _stream(row: Sequence[Any]) -> tuple[int, int]:
    return row[0], row[1]
