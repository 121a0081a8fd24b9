"""What is known of one frame: its parent and its pose there, over time or for good."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import NamedTuple, Protocol

from metaros.ros2.tf2_py.rotations import Quaternion, Vector, slerp

__all__ = ["Cache", "Gap", "Sample", "StaticCache", "TimeCache", "seconds"]


class Sample(NamedTuple):
    """Where a frame was at a time: a vector in its parent is `rotate(rotation, vector) + translation`."""

    stamp_ns: int
    parent: str
    translation: Vector
    rotation: Quaternion


class Gap(NamedTuple):
    """Why there is no sample of a time. `kind` is future, past, single or empty; `stored_ns` the nearest that is."""

    kind: str
    asked_ns: int
    stored_ns: int

    def text(self, frame: str) -> str:
        """The reason in words; what is fixed in them is what programs and their tests look for."""
        asked, stored = seconds(self.asked_ns), seconds(self.stored_ns)
        if self.kind == "future":
            return (
                f"Lookup would require extrapolation into the future: time {asked} was asked for, "
                f"and the latest data of frame [{frame}] is of {stored}"
            )
        if self.kind == "past":
            return (
                f"Lookup would require extrapolation into the past: time {asked} was asked for, "
                f"and the earliest data of frame [{frame}] is of {stored}"
            )
        if self.kind == "single":
            return (
                f"Lookup would require extrapolation at time {asked}: the only data of frame [{frame}] is of {stored}"
            )
        return f"Lookup would require extrapolation at time {asked}: there is no data of frame [{frame}]"


class Cache(Protocol):
    """What the walk through the tree asks of a frame. Times are nanoseconds; 0 means the newest there is."""

    def insert(self, sample: Sample) -> bool:
        """Keep it; False if it is too old for that."""

    def at(self, time_ns: int) -> Sample | Gap:
        """The pose at that time, between two samples by interpolation."""

    def parent_at(self, time_ns: int) -> str | Gap:
        """The parent at that time."""

    def latest(self) -> tuple[int, str] | None:
        """Time and parent of the newest sample; None if there is none. The time of what is static is 0."""

    def span_ns(self) -> tuple[int, int]:
        """Oldest and newest time; zeros for what is static or empty."""

    def clear(self) -> None:
        """Forget what is of a time; what is static stays."""

    def __len__(self) -> int: ...


class StaticCache:
    """A frame that never moves in its parent."""

    __slots__ = ("_sample",)

    def __init__(self) -> None:
        self._sample: Sample | None = None

    def insert(self, sample: Sample) -> bool:
        """Takes the place of what was there."""
        self._sample = sample
        return True

    def at(self, time_ns: int) -> Sample | Gap:
        """The same at every time."""
        return Gap("empty", time_ns, 0) if self._sample is None else self._sample

    def parent_at(self, time_ns: int) -> str | Gap:
        """The same at every time."""
        return Gap("empty", time_ns, 0) if self._sample is None else self._sample.parent

    def latest(self) -> tuple[int, str] | None:
        """Of no time."""
        return None if self._sample is None else (0, self._sample.parent)

    def span_ns(self) -> tuple[int, int]:
        """Of no time."""
        return (0, 0)

    def clear(self) -> None:
        """Nothing goes: a static transform is told once."""

    def __len__(self) -> int:
        return 1


class TimeCache:
    """Samples in the order of their times, for `keep_ns` back from the newest and at most `most` of them."""

    __slots__ = ("_keep_ns", "_most", "_samples", "_stamps")

    def __init__(self, keep_ns: int, most: int) -> None:
        self._keep_ns = keep_ns
        self._most = most
        self._stamps: list[int] = []
        self._samples: list[Sample] = []

    def insert(self, sample: Sample) -> bool:
        """Keep it in its place; the same twice is kept once. As in tf2, what it makes too old goes with the next."""
        stamps, samples, stamp_ns = self._stamps, self._samples, sample.stamp_ns
        if stamps:
            oldest_ns = stamps[-1] - self._keep_ns
            if stamps[0] < oldest_ns:
                old = bisect_left(stamps, oldest_ns)
                del stamps[:old], samples[:old]
            if stamp_ns < oldest_ns:
                return False
            place = bisect_right(stamps, stamp_ns)
            first = place
            while first and stamps[first - 1] == stamp_ns:
                first -= 1
                if samples[first] == sample:
                    return True
            stamps.insert(place, stamp_ns)
            samples.insert(place, sample)
            if len(stamps) > self._most:
                del stamps[0], samples[0]
        else:
            stamps.append(stamp_ns)
            samples.append(sample)
        return True

    def at(self, time_ns: int) -> Sample | Gap:
        """Between two samples of one parent: translations by line, rotations by the shortest arc; else the earlier."""
        found = self._around(time_ns)
        if isinstance(found, Gap):
            return found
        older = self._samples[found]
        if found + 1 == len(self._samples) or time_ns in (0, older.stamp_ns):
            return older
        newer = self._samples[found + 1]
        if newer.parent != older.parent:
            return older
        ratio = (time_ns - older.stamp_ns) / (newer.stamp_ns - older.stamp_ns)
        ax, ay, az = older.translation
        bx, by, bz = newer.translation
        rest = 1.0 - ratio
        between = (rest * ax + ratio * bx, rest * ay + ratio * by, rest * az + ratio * bz)
        return Sample(older.stamp_ns, older.parent, between, slerp(older.rotation, newer.rotation, ratio))

    def parent_at(self, time_ns: int) -> str | Gap:
        """The parent at that time."""
        found = self._around(time_ns)
        return self._samples[found].parent if isinstance(found, int) else found

    def latest(self) -> tuple[int, str] | None:
        """Time and parent of the newest sample."""
        return (self._stamps[-1], self._samples[-1].parent) if self._stamps else None

    def span_ns(self) -> tuple[int, int]:
        """Oldest and newest time."""
        return (self._stamps[0], self._stamps[-1]) if self._stamps else (0, 0)

    def clear(self) -> None:
        """Forget all samples."""
        self._stamps.clear()
        self._samples.clear()

    def __len__(self) -> int:
        return len(self._stamps)

    def _around(self, time_ns: int) -> int | Gap:
        """The index of the last sample that is not after that time, which must lie within what is stored."""
        stamps = self._stamps
        if not stamps:
            return Gap("empty", time_ns, 0)
        newest = stamps[-1]
        if time_ns in (0, newest):
            return len(stamps) - 1
        if len(stamps) == 1:
            return Gap("single", time_ns, newest)
        if time_ns > newest:
            return Gap("future", time_ns, newest)
        if time_ns < stamps[0]:
            return Gap("past", time_ns, stamps[0])
        if time_ns == stamps[0]:
            return 0
        return bisect_right(stamps, time_ns) - 1


def seconds(time_ns: int) -> str:
    """A time in seconds, to the microsecond."""
    sign, time_ns = ("-", -time_ns) if time_ns < 0 else ("", time_ns)
    return f"{sign}{time_ns // 1_000_000_000}.{time_ns % 1_000_000_000 // 1000:06d}"
