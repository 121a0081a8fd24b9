"""What can be asked of the writer: everything one commit may hold."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows

__all__ = ["RobotWrite", "StreamWrite", "Write"]

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
    """A stream's watermark moves to `seq`, with the rows and gaps that moved it; all of it or nothing."""

    robot: str
    stream_id: int
    epoch: int
    seq: int
    rows: Rows | None = None
    gap: Gap | None = None
    session_number: int = 0

    @property
    def size_bytes(self) -> int:
        """What it holds of the writer's queue."""
        return ROW_OVERHEAD_BYTES + (20 * len(self.rows) if self.rows is not None else 0)


Write = RobotWrite | StreamWrite
