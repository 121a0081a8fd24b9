"""What can be asked of the writer: everything one commit may hold."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run

__all__ = ["RobotWrite", "StreamWrite", "Write", "WriterWrite"]

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
    """A stream's watermark moves to `seq`, with the samples, rows or gap that moved it; all of it or nothing."""

    robot: str
    stream_id: int
    epoch: int
    seq: int
    rows: Rows | None = None
    gap: Gap | None = None
    run: Run | None = None

    @property
    def size_bytes(self) -> int:
        """What it holds of the writer's queue."""
        rows = 20 * len(self.rows) if self.rows is not None else 0
        return ROW_OVERHEAD_BYTES + rows + (12 * self.run.count + self.run.size_bytes if self.run is not None else 0)


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
