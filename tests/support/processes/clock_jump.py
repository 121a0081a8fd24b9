"""Clocks that a test sets ahead: time-outs expire at once, and nothing else runs faster."""

from __future__ import annotations

from metaros.clock import SystemClock

__all__ = ["LeapingClock"]


class LeapingClock(SystemClock):
    """The machine's seconds and calendar, and what was leapt over of each."""

    __slots__ = ("_ahead_s", "_calendar_ns")

    def __init__(self) -> None:
        self._ahead_s, self._calendar_ns = 0.0, 0

    def wall_ns(self) -> int:  # type: ignore[override]
        """What the calendar says."""
        return SystemClock.wall_ns() + self._calendar_ns

    def monotonic_s(self) -> float:  # type: ignore[override]
        """Seconds, never decreasing."""
        return SystemClock.monotonic_s() + self._ahead_s

    def leap(self, seconds: float) -> None:
        """Be so much later at once; the calendar stays."""
        self._ahead_s += seconds

    def set_calendar(self, seconds: float) -> None:
        """Set the calendar so far ahead of the machine's; the seconds stay."""
        self._calendar_ns = round(seconds * 1e9)
