"""What the log has records of: rows that are about to be committed, and cycles of the evaluator."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import orjson

__all__ = ["CYCLE", "ROWS", "Cycle", "Mark", "RowsEntry", "pack_cycle", "pack_rows", "unpack_cycle", "unpack_rows"]

ROWS, CYCLE = 1, 2
Mark = tuple[str, int, int]  # robot, stream, epoch: whose watermark
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True, slots=True, kw_only=True)
class RowsEntry:
    """Metric rows of one robot that were handed to the store: numbers `first_seq` to `seq` of its metric stream.

    `series` are (name, topic); `index` points into it; stamps are ns by the robot's clock.
    """

    robot: str
    stream_id: int
    epoch: int
    first_seq: int
    seq: int
    series: tuple[tuple[str, str], ...]
    index: npt.NDArray[np.uint32]
    stamps: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def mark(self) -> Mark:
        """Whose watermark says that it is committed."""
        return self.robot, self.stream_id, self.epoch

    def span(self, after: int, up_to: int) -> slice:
        """Which rows have numbers over `after` and not over `up_to`."""
        return slice(max(0, after + 1 - self.first_seq), max(0, min(up_to, self.seq) + 1 - self.first_seq))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """What the evaluator is given at once: how far each robot's rows are committed, facts in their order, and the time.

    A fact is the name of one of `gateway.alerting.watch.state_machine.FACTS`, then its arguments.
    """

    now_s: float
    marks: dict[Mark, int]
    facts: Sequence[Sequence[Any]]


def pack_rows(entry: RowsEntry) -> bytes:
    """An entry as a record's payload."""
    head = orjson.dumps([*entry.mark, entry.first_seq, entry.seq, entry.series])
    stamps, values, index = entry.stamps, entry.values, entry.index.astype("<u4", copy=False)
    return b"".join((_LENGTH.pack(len(head)), head, stamps.data, values.data, index.data))


def unpack_rows(payload: bytes) -> RowsEntry:
    """The entry that a payload is."""
    (length,) = _LENGTH.unpack_from(payload)
    start = _LENGTH.size + length
    robot, stream_id, epoch, first_seq, seq, series = orjson.loads(payload[_LENGTH.size : start])
    count = (len(payload) - start) // 20
    return RowsEntry(
        robot=robot,
        stream_id=stream_id,
        epoch=epoch,
        first_seq=first_seq,
        seq=seq,
        series=tuple((name, topic) for name, topic in series),
        stamps=np.frombuffer(payload, "<i8", count, start),
        values=np.frombuffer(payload, "<f8", count, start + 8 * count),
        index=np.frombuffer(payload, "<u4", count, start + 16 * count),
    )


def pack_cycle(cycle: Cycle) -> bytes:
    """A cycle as a record's payload."""
    marks = [(*mark, seq) for mark, seq in cycle.marks.items()]
    return orjson.dumps([cycle.now_s, marks, cycle.facts])


def unpack_cycle(payload: bytes) -> Cycle:
    """The cycle that a payload is."""
    now_s, marks, facts = orjson.loads(payload)
    return Cycle(now_s=now_s, marks={(robot, stream, epoch): seq for robot, stream, epoch, seq in marks}, facts=facts)
