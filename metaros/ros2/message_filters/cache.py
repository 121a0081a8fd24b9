"""The last messages of a filter, to be asked for by time."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Any

from metaros.ros2.message_filters.simple_filter import SimpleFilter, stamp_of

__all__ = ["Cache"]


class Cache(SimpleFilter):
    """Keeps the `cache_size` newest messages of the filter `f` in the order of their times, and hands all of them on.

    Times are `rclpy.time.Time`. With `allow_headerless` a message without a header counts from when it came.
    """

    def __init__(self, f: SimpleFilter, cache_size: int = 1, allow_headerless: bool = False) -> None:
        super().__init__()
        self.cache_size = cache_size
        self.cache_msgs: list[Any] = []
        self.cache_times: list[Any] = []
        self.allow_headerless = allow_headerless
        self.connectInput(f)

    def connectInput(self, f: SimpleFilter) -> None:
        """Take what this filter puts out, too."""
        self.incoming_connection = f.registerCallback(self.add)

    def add(self, msg: Any) -> None:
        """Take a message in."""
        stamp = stamp_of(msg, self.allow_headerless, "message_filters_cache")
        if stamp is None:
            return
        place = bisect_right(self.cache_times, stamp.nanoseconds, key=_ns)
        self.cache_times.insert(place, stamp)
        self.cache_msgs.insert(place, msg)
        if len(self.cache_msgs) > self.cache_size:
            del self.cache_msgs[0], self.cache_times[0]
        self.signalMessage(msg)

    def getInterval(self, from_stamp: Any, to_stamp: Any) -> list[Any]:
        """The messages from one time to another, both included."""
        if not from_stamp <= to_stamp:
            raise AssertionError(f"an interval ends after it begins: {from_stamp} to {to_stamp}")
        return self.cache_msgs[self._before(from_stamp) : self._behind(to_stamp)]

    def getSurroundingInterval(self, from_stamp: Any, to_stamp: Any) -> list[Any]:
        """The same, and the message before and the one after, so that values at both ends can be interpolated."""
        first, last = max(0, self._behind(from_stamp) - 1), self._before(to_stamp) + 1
        return self.cache_msgs[first:last]

    def getElemAfterTime(self, stamp: Any) -> Any:
        """The oldest message of that time or later, or None."""
        place = self._before(stamp)
        return self.cache_msgs[place] if place < len(self.cache_msgs) else None

    def getElemBeforeTime(self, stamp: Any) -> Any:
        """The newest message of that time or earlier, or None."""
        place = self._behind(stamp)
        return self.cache_msgs[place - 1] if place else None

    def getLastestTime(self) -> Any:
        """The time of the newest message, or None."""
        return self.cache_times[-1] if self.cache_times else None

    def getLatestTime(self) -> Any:
        """The time of the newest message, or None."""
        return self.getLastestTime()

    def getOldestTime(self) -> Any:
        """The time of the oldest message, or None."""
        return self.cache_times[0] if self.cache_times else None

    def getLast(self) -> Any:
        """The newest message, or None."""
        return self.cache_msgs[-1] if self.cache_msgs else None

    def _before(self, stamp: Any) -> int:
        """How many messages are earlier."""
        return bisect_left(self.cache_times, stamp.nanoseconds, key=_ns)

    def _behind(self, stamp: Any) -> int:
        """How many messages are earlier or of that time."""
        return bisect_right(self.cache_times, stamp.nanoseconds, key=_ns)


def _ns(stamp: Any) -> int:
    found: int = stamp.nanoseconds
    return found
