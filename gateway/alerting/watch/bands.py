"""What some series were and were expected to be lately: of those that alerted, and of those that somebody looks at."""

from __future__ import annotations

import math
import struct
import threading
from collections import OrderedDict
from collections.abc import Iterable

from gateway.alerting.watch.rows import BandPoint

__all__ = ["Bands"]

MAX_SERIES = 512  # an hour of each, at one cycle a second: 74 MB
MAX_OF_ROBOT = 64  # who asks for all of one robot's takes no other's place
MAX_POINTS = 3600
Key = tuple[str, str]  # robot, series
_POINT = struct.Struct("<qdddd")


class Bands:
    """Filled by the evaluator's thread, read on the event loop."""

    def __init__(
        self, *, max_series: int = MAX_SERIES, max_of_robot: int = MAX_OF_ROBOT, max_points: int = MAX_POINTS
    ) -> None:
        self._max_series = max_series
        self._max_of_robot = max_of_robot
        self._max_points = max_points
        self._points: OrderedDict[Key, Ring] = OrderedDict()
        self._lock = threading.Lock()

    def want(self, robot: str, series: str) -> None:
        """Keep points of this series from now on; the one that was wanted longest ago gives way."""
        with self._lock:
            if (robot, series) not in self._points:
                self._points[robot, series] = Ring(self._max_points)
                mine = [key for key in self._points if key[0] == robot]
                if len(mine) > self._max_of_robot:
                    del self._points[mine[0]]
            self._points.move_to_end((robot, series))
            while len(self._points) > self._max_series:
                self._points.popitem(last=False)

    def wanted(self) -> dict[str, set[str]]:
        """The series to keep points of, by robot."""
        found: dict[str, set[str]] = {}
        with self._lock:
            for robot, series in self._points:
                found.setdefault(robot, set()).add(series)
        return found

    def add(self, points: Iterable[tuple[Key, BandPoint]]) -> None:
        """Take points of wanted series in."""
        with self._lock:
            for key, point in points:
                if (kept := self._points.get(key)) is not None:
                    kept.add(point)

    def read(self, robot: str, series: str, from_ns: int, to_ns: int) -> list[BandPoint]:
        """The points of a span, the oldest first."""
        with self._lock:
            ring = self._points.get((robot, series))
            packed = ring.packed() if ring is not None else b""
        return [_unpacked(*row) for row in _POINT.iter_unpack(packed) if from_ns <= row[0] <= to_ns]


class Ring:
    """The newest points of one series, packed."""

    def __init__(self, most: int) -> None:
        self._size = most * _POINT.size
        self._data = bytearray()
        self._at = 0  # where the next one goes

    def add(self, point: BandPoint) -> None:
        """One more; of too many the oldest goes."""
        low, high = (math.nan if bound is None else bound for bound in (point.low, point.high))
        row = _POINT.pack(point.stamp_ns, point.value, low, high, point.score)
        self._data[self._at : self._at + _POINT.size] = row
        self._at = (self._at + _POINT.size) % self._size

    def packed(self) -> bytes:
        """All of them, the oldest first."""
        oldest = self._at if len(self._data) == self._size else 0
        return bytes(self._data[oldest:] + self._data[:oldest])


def _unpacked(stamp_ns: int, value: float, low: float, high: float, score: float) -> BandPoint:
    return BandPoint(stamp_ns, value, None if math.isnan(low) else low, None if math.isnan(high) else high, score)
