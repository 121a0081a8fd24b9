"""Deadlines: how many periods went by without a sample."""

from __future__ import annotations

import math

__all__ = ["DeadlineMonitor"]


class DeadlineMonitor:
    """Counts missed periods. Pure: times are given, seconds of one monotonic clock.

    The first sample starts it. After a sample one miss counts for every period that ends without another. A sample
    exactly on time is in time.
    """

    def __init__(self, period_s: float) -> None:
        self.total = 0
        self._period_s = period_s
        self._due_s: float | None = None  # when the next miss counts; None before the first sample
        self._unreported = 0

    def mark(self, now_s: float) -> None:
        """A sample was sent, or came."""
        due_s = self._due_s
        if due_s is not None and now_s > due_s:
            self._unreported += self._ended(due_s, now_s)
        self._due_s = now_s + self._period_s

    def excuse(self, now_s: float) -> None:
        """A sample is here whose time nobody noted: nothing that ended until now counts, a period begins."""
        if self._due_s is not None:
            self._due_s = max(self._due_s, now_s + self._period_s)

    def check(self, now_s: float) -> int:
        """The misses since the last check."""
        due_s = self._due_s
        if due_s is not None and now_s >= due_s:
            ended = self._ended(due_s, now_s)
            self._unreported += ended
            due_s += ended * self._period_s
            self._due_s = due_s if due_s > now_s else now_s + self._period_s  # the sum may be rounded down onto now
        missed, self._unreported = self._unreported, 0
        self.total += missed
        return missed

    def next_check_s(self, now_s: float) -> float:
        """When a check may next find something."""
        return now_s + self._period_s if self._due_s is None else self._due_s

    def _ended(self, due_s: float, now_s: float) -> int:
        return math.floor((now_s - due_s) / self._period_s) + 1
