"""Rows as the store's writer hands them on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gateway.alerting.watch.entries import RowsEntry
from gateway.domain.channel import Series
from gateway.domain.sample import Rows
from gateway.store.writes import StreamWrite

START_S = 1_700_000_000

__all__ = ["START_S", "entry", "write"]


def entry(
    first_seq: int, count: int, *, robot: str = "r1", epoch: int = 7, series: Sequence[str] = ("a.x",)
) -> RowsEntry:
    """Rows with numbers from `first_seq`; a row's value is its number."""
    numbers = np.arange(first_seq, first_seq + count)
    return RowsEntry(
        robot=robot,
        stream_id=0,
        epoch=epoch,
        first_seq=first_seq,
        seq=first_seq + count - 1,
        series=tuple((name, "/a") for name in series),
        index=(numbers % len(series)).astype(np.uint32),
        stamps=(START_S + numbers) * 10**9,
        values=numbers.astype(np.float64),
    )


def write(
    first_seq: int, count: int, *, robot: str = "r1", epoch: int = 7, series: Sequence[str] = ("a.x",)
) -> StreamWrite:
    """The same as the store is handed it."""
    made = entry(first_seq, count, robot=robot, epoch=epoch, series=series)
    rows = Rows(tuple(Series(name, topic, "x") for name, topic in made.series), made.index, made.stamps, made.values)
    return StreamWrite(robot=robot, stream_id=0, epoch=epoch, seq=made.seq, rows=rows)
