"""The machine's clock, which a test sets ahead: what waits for a time-out has waited, and nothing else is hurried."""

from __future__ import annotations

from metaros.clock import SystemClock

__all__ = ["LeapingClock"]


class LeapingClock(SystemClock):
    """Its monotonic seconds are the machine's, and those that were leapt over; the calendar is the machine's."""

    __slots__ = ("_ahead_s",)

    def __init__(self) -> None:
        self._ahead_s = 0.0

    def monotonic_s(self) -> float:  # type: ignore[override]
        """Seconds, never decreasing."""
        return SystemClock.monotonic_s() + self._ahead_s

    def leap(self, seconds: float) -> None:
        """Be so much later at once."""
        self._ahead_s += seconds
