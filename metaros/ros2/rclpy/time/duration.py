"""`rclpy.duration`: spans of time in whole nanoseconds."""

from __future__ import annotations

import math
from functools import total_ordering
from typing import Any, Final

from metaros.ros2.rclpy.names.constants import S_TO_NS
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["Duration", "Infinite"]

_END: Final = 2**63  # of what a signed 64-bit number holds
_INFINITE_NS: Final = 9_223_372_036_854_775_807  # what the middleware means by "for ever"


@total_ordering
class Duration:
    """A span of time, negative ones included, as nanoseconds in 64 bits.

    Parts of a nanosecond are left out.

    Raises:
        OverflowError: 64 bits cannot hold it.
    """

    __slots__ = ("__weakref__", "_nanoseconds")

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        total = int(seconds * S_TO_NS) + int(nanoseconds)
        if not -_END <= total < _END:
            raise OverflowError(f"a duration of {total} nanoseconds does not fit into 64 bits")
        self._nanoseconds = total

    @property
    def nanoseconds(self) -> int:
        """The whole of it."""
        return self._nanoseconds

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._nanoseconds})"

    def __str__(self) -> str:
        return "Infinite" if self._nanoseconds == _INFINITE_NS else f"{self._nanoseconds} nanoseconds"

    # -- arithmetic ------------------------------------------------------------------------------------------------

    def __add__(self, other: object) -> Duration:
        if isinstance(other, Duration):
            return Duration(nanoseconds=self._nanoseconds + other._nanoseconds)
        return NotImplemented

    def __sub__(self, other: object) -> Duration:
        if isinstance(other, Duration):
            return Duration(nanoseconds=self._nanoseconds - other._nanoseconds)
        return NotImplemented

    def __mul__(self, factor: float) -> Duration:
        if isinstance(factor, int):
            return Duration(nanoseconds=self._nanoseconds * factor)
        if isinstance(factor, float):
            if factor == math.inf:
                return Infinite
            if not math.isfinite(factor):
                raise ValueError(f"a duration cannot be multiplied by {factor}")
            return Duration(nanoseconds=self._nanoseconds * factor)
        return NotImplemented

    __rmul__ = __mul__

    def __neg__(self) -> Duration:
        return Duration(nanoseconds=-self._nanoseconds)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Duration):
            return self._nanoseconds == other._nanoseconds
        return NotImplemented

    def __lt__(self, other: object) -> bool:
        if isinstance(other, Duration):
            return self._nanoseconds < other._nanoseconds
        return NotImplemented

    def __hash__(self) -> int:
        return hash(self._nanoseconds)

    # -- messages --------------------------------------------------------------------------------------------------

    def to_msg(self) -> Any:
        """As builtin_interfaces.msg.Duration."""
        seconds, nanoseconds = divmod(self._nanoseconds, S_TO_NS)
        return interface("builtin_interfaces/msg/Duration")(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: Any) -> Duration:
        """Of a builtin_interfaces.msg.Duration; TypeError of anything else."""
        if not isinstance(msg, interface("builtin_interfaces/msg/Duration")):
            raise TypeError(f"Must pass a builtin_interfaces.msg.Duration object, not {type(msg).__name__}")
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec)

    def get_c_duration(self) -> Duration:
        """Itself: there is no other form of it here."""
        return self


Infinite: Final = Duration(nanoseconds=_INFINITE_NS)  # for ever
