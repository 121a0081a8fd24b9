"""The moments of this machine's clock that were told over a link: from one of them every lease counts. Pure.

The gateway cannot know how long its words take, nor what the calendars of the two machines say. So it says from which
of our own moments a lease counts, and words that come late give the less the later they are.
"""

from __future__ import annotations

__all__ = ["Moments"]


class Moments:
    """Of one link at a time; nanoseconds of `metaros.clock.boot_s`."""

    def __init__(self) -> None:
        self._first_ns = self._last_ns = 0

    def tell(self, now_ns: int) -> int:
        """Tell this one."""
        self._first_ns = self._first_ns or now_ns
        self._last_ns = now_ns
        return now_ns

    def knows(self, since_ns: int) -> bool:
        """Whether a lease may count from there: not from what another link, or the machine before a restart, told."""
        return 0 < self._first_ns <= since_ns <= self._last_ns

    def forget(self) -> None:
        """Another link begins, or none."""
        self._first_ns = self._last_ns = 0
