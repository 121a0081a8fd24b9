"""Times and headers of converted messages."""

from __future__ import annotations

from typing import Any

from metaros.errors import FieldError
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["header", "stamp", "stamp_ns_of"]

_MAX_NS = (2**31 - 1) * 1_000_000_000  # builtin_interfaces/Time counts seconds in an int32


def stamp(stamp_ns: int) -> Time:
    """Nanoseconds since the epoch, as `clock.wall_ns()` gives them, as a Time."""
    if not 0 <= stamp_ns <= _MAX_NS:
        raise FieldError(f"stamp_ns: {stamp_ns} is no time between 1970 and 2038")
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def stamp_ns_of(time: Any) -> int:
    """The reverse of `stamp`."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def header(stamp_ns: int, frame_id: str) -> Header:
    """A header of that time and frame."""
    return Header(stamp=stamp(stamp_ns), frame_id=frame_id)
