"""An event loop with accelerated time: what waits for seconds waits for milliseconds.

Threads and files take the time that they take; so what is real about a test stays real, and only the waiting shrinks.
"""

from __future__ import annotations

import asyncio
import selectors

from metaros.clock import SystemClock

__all__ = ["SPEED", "HurriedClock", "HurriedLoop"]

SPEED = 20.0


class HurriedClock(SystemClock):
    """Its monotonic seconds are those of `HurriedLoop`, from `offset_s` on; the calendar is the machine's."""

    __slots__ = ("_offset_s", "_speed")

    def __init__(self, offset_s: float = 0.0, *, speed: float = SPEED) -> None:
        self._speed = speed
        self._offset_s = offset_s - SystemClock.monotonic_s() * speed

    def monotonic_s(self) -> float:  # type: ignore[override]
        """Seconds, `speed` of them in one of the machine's."""
        return SystemClock.monotonic_s() * self._speed + self._offset_s


class _Selector(selectors.DefaultSelector):
    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Wait for so many short seconds."""
        return super().select(timeout / SPEED if timeout else timeout)


class HurriedLoop(asyncio.SelectorEventLoop):
    """`asyncio.sleep(1)` takes 1/SPEED of a second in it."""

    def __init__(self) -> None:
        super().__init__(_Selector())

    def time(self) -> float:
        """Seconds, SPEED of them in one of the machine's."""
        return super().time() * SPEED
