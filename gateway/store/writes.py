"""The writer's operations, and the result of a commit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run

__all__ = ["Committed", "Mark", "RobotWrite", "StreamWrite", "Write", "WriterWrite"]

ROW_OVERHEAD_BYTES = 256  # what a queued write costs beside its columns


@dataclass(frozen=True, slots=True)
class RobotWrite:
    """A robot said hello, or was seen again."""

    robot: Robot
    seen_ns: int

    @property
    def size_bytes(self) -> int:
        """What it holds of the writer's queue."""
        return ROW_OVERHEAD_BYTES


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamWrite:
    """Samples, rows or a gap of a stream, up to number `seq`; without any of them it only asks for the watermark.

    It is stored when it follows the stream's watermark, which for a stream never seen is `base`.
    """

    robot: str
    stream_id: int
    epoch: int
    seq: int
    rows: Rows | None = None
    gap: Gap | None = None
    run: Run | None = None
    base: int = 0

    @property
    def first_seq(self) -> int:
        """Its first number; past `seq` when it has none."""
        if self.run is not None:
            return self.seq - self.run.count + 1
        if self.rows is not None:
            return self.seq - len(self.rows) + 1
        return self.gap.from_seq if self.gap is not None else self.seq + 1

    @property
    def size_bytes(self) -> int:
        """What it holds of the writer's queue."""
        rows = 20 * len(self.rows) if self.rows is not None else 0
        return ROW_OVERHEAD_BYTES + rows + (12 * self.run.count + self.run.size_bytes if self.run is not None else 0)

    def after(self, watermark: int) -> StreamWrite | None:
        """What of it is new and may be stored; None when nothing is.

        A write that does not follow the watermark is not stored at all: what was before it had been refused, and
        comes again together with it.
        """
        first_seq = self.first_seq
        if first_seq > watermark + 1 or self.seq <= watermark or first_seq > self.seq:
            return None
        skip = watermark + 1 - first_seq
        if skip == 0:
            return self
        return replace(
            self,
            run=self.run.after(skip) if self.run is not None else None,
            rows=self.rows.after(skip) if self.rows is not None else None,
            gap=replace(self.gap, from_seq=watermark + 1) if self.gap is not None else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WriterWrite:
    """A process of the robot's agent now writes under an epoch; it goes before what it sends."""

    robot: str
    epoch: int
    writer: str

    @property
    def size_bytes(self) -> int:
        """What it holds of the writer's queue."""
        return ROW_OVERHEAD_BYTES


Write = RobotWrite | StreamWrite | WriterWrite


class Mark(NamedTuple):
    """A stream's watermark as it is stored: what may be acknowledged."""

    robot: str
    stream_id: int
    epoch: int
    seq: int


@dataclass(frozen=True, slots=True)
class Committed:
    """What a commit did: its writes, and the watermark of every stream they named."""

    writes: Sequence[Write]
    marks: Sequence[Mark]
