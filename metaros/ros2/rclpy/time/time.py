"""`rclpy.time`: points in time, each of one kind of clock."""

from __future__ import annotations

from typing import Any, Final

from metaros.ros2.rclpy.names.constants import S_TO_NS
from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["Time"]

_END: Final = 2**63  # of what a signed 64-bit number holds


class Time:
    """A point in time: nanoseconds since the start of its clock. Times of two kinds of clock cannot be compared.

    Raises:
        ValueError: it would be negative.
        OverflowError: 64 bits cannot hold it.
        TypeError: `clock_type` is no ClockType.
    """

    __slots__ = ("__weakref__", "_clock_type", "_nanoseconds")

    def __init__(
        self, *, seconds: float = 0, nanoseconds: float = 0, clock_type: ClockType = ClockType.SYSTEM_TIME
    ) -> None:
        if not isinstance(clock_type, ClockType):
            raise TypeError(f"Clock type must be a ClockType enum, not {clock_type!r}")
        if seconds < 0:
            raise ValueError("Seconds value must not be negative")
        if nanoseconds < 0:
            raise ValueError("Nanoseconds value must not be negative")
        total = int(seconds * S_TO_NS) + int(nanoseconds)
        if total >= _END:
            raise OverflowError(f"a time of {total} nanoseconds does not fit into 64 bits")
        self._nanoseconds = total
        self._clock_type = clock_type

    @property
    def nanoseconds(self) -> int:
        """Since the clock's start."""
        return self._nanoseconds

    @property
    def clock_type(self) -> ClockType:
        """Of which kind of clock."""
        return self._clock_type

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Whole seconds, and the rest in nanoseconds."""
        return divmod(self._nanoseconds, S_TO_NS)

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self._nanoseconds}, clock_type={self._clock_type.name})"

    # -- arithmetic ------------------------------------------------------------------------------------------------

    def __add__(self, other: object) -> Time:
        if isinstance(other, Duration):
            return self._moved(other.nanoseconds)
        return NotImplemented

    __radd__ = __add__

    def __sub__(self, other: object) -> Any:
        """A Duration between two times, or the time so much earlier."""
        if isinstance(other, Time):
            if self._clock_type != other._clock_type:
                raise TypeError("Can't subtract times with different clock types")
            return Duration(nanoseconds=self._nanoseconds - other._nanoseconds)
        if isinstance(other, Duration):
            return self._moved(-other.nanoseconds)
        return NotImplemented

    def _moved(self, by_ns: int) -> Time:
        total = self._nanoseconds + by_ns
        if total < 0:
            raise ValueError("the time would be negative, before its clock's start")
        return Time(nanoseconds=total, clock_type=self._clock_type)

    # -- comparison ------------------------------------------------------------------------------------------------

    def _checked(self, other: Time) -> int:
        if self._clock_type != other._clock_type:
            raise TypeError("Can't compare times with different clock types")
        return other._nanoseconds

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds == self._checked(other)
        return NotImplemented

    def __ne__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds != self._checked(other)
        return NotImplemented

    def __lt__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds < self._checked(other)
        return NotImplemented

    def __le__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds <= self._checked(other)
        return NotImplemented

    def __gt__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds > self._checked(other)
        return NotImplemented

    def __ge__(self, other: object) -> bool:
        if isinstance(other, Time):
            return self._nanoseconds >= self._checked(other)
        return NotImplemented

    def __hash__(self) -> int:
        return hash((self._nanoseconds, self._clock_type))

    # -- messages --------------------------------------------------------------------------------------------------

    def to_msg(self) -> Any:
        """As builtin_interfaces.msg.Time, which does not say of which clock."""
        seconds, nanoseconds = self.seconds_nanoseconds()
        return interface("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> Time:
        """Of a builtin_interfaces.msg.Time; TypeError of anything else."""
        if not isinstance(msg, interface("builtin_interfaces/msg/Time")):
            raise TypeError(f"Must pass a builtin_interfaces.msg.Time object, not {type(msg).__name__}")
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec, clock_type=clock_type)
