"""Time and randomness as arguments: the only module that reads the machine's clocks.

Code that needs time takes a `Clock`; code that needs chance takes a `random.Random`. Programs make both here, at
their edge; tests pass a `ManualClock` and a seeded generator, and never sleep.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import random

__all__ = ["Clock", "ManualClock", "SystemClock", "boot_s", "system_rng"]


class Clock(Protocol):
    """Two readings: what the calendar says, and a count that never runs backwards."""

    def wall_ns(self) -> int:
        """Nanoseconds since the Unix epoch; may jump when the machine's time is set."""

    def monotonic_s(self) -> float:
        """Seconds from an arbitrary start, never decreasing; use it for timers and ages."""


class SystemClock:
    """The machine's own clocks: the C functions themselves, since every published sample asks for the time."""

    __slots__ = ()

    wall_ns = staticmethod(time.time_ns)
    monotonic_s = staticmethod(time.monotonic)


class ManualClock:
    """A clock that moves only when told: for tests and deterministic simulation."""

    __slots__ = ("_monotonic_s", "_wall_ns")

    def __init__(self, *, wall_ns: int = 1_700_000_000_000_000_000, monotonic_s: float = 1000.0) -> None:
        self._wall_ns = wall_ns
        self._monotonic_s = monotonic_s

    def wall_ns(self) -> int:
        """Nanoseconds since the Unix epoch, as set."""
        return self._wall_ns

    def monotonic_s(self) -> float:
        """Seconds, as advanced."""
        return self._monotonic_s

    def advance(self, seconds: float) -> None:
        """Move both clocks forward by `seconds` (>= 0)."""
        if seconds < 0:
            raise ValueError("a clock advances by zero seconds or more; use jump_wall to set the calendar back")
        self._monotonic_s += seconds
        self._wall_ns += round(seconds * 1e9)

    def jump_wall(self, seconds: float) -> None:
        """Set the calendar forwards or backwards, as NTP or an operator would; the monotonic clock stays."""
        self._wall_ns += round(seconds * 1e9)


def boot_s() -> float:
    """Seconds since the machine's start: the same in all its processes, never decreasing. On Linux it goes on while the
    machine is suspended, as a lease does.
    """
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    else:
        return time.monotonic()


def system_rng() -> random.Random:
    """A generator seeded by the operating system, for programs that were given no seed."""
    import random

    return random.Random()
