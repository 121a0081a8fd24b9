"""The clock stamps that were sent over a link: every lease counts from one of them. Pure.

The gateway cannot know how long its words take, nor what the calendars of the two machines say. So it says from which
of our own moments a lease counts, and words that come late give the less the later they are.
"""

from __future__ import annotations

__all__ = ["LeaseStamps"]


class LeaseStamps:
    """The stamps of one link at a time; nanoseconds of `metaros.clock.boot_s`."""

    def __init__(self) -> None:
        self._first_ns = self._last_ns = 0

    def issue(self, now_ns: int) -> int:
        """Record a stamp that is being sent, and return it."""
        self._first_ns = self._first_ns or now_ns
        self._last_ns = now_ns
        return now_ns

    def knows(self, since_ns: int) -> bool:
        """Whether a lease may count from there: not from a stamp of another link, or from before a reboot."""
        return 0 < self._first_ns <= since_ns <= self._last_ns

    def forget(self) -> None:
        """Another link begins, or none."""
        self._first_ns = self._last_ns = 0
