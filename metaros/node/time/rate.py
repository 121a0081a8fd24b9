"""A rate: sleep so that a loop runs so many times a second, by the node's clock and without drift."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from metaros.clock import Clock
from metaros.concurrency.waiting import Wakeup
from metaros.errors import UsageError
from metaros.lazy_import import LazyModule
from metaros.node.time.sim_time import SimClock

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = LazyModule("asyncio")

__all__ = ["Rate"]


class Rate:
    """`sleep()` returns at the next whole period; False once the node is closed.

    A loop that took longer than a period goes on at once, and the periods it missed are counted, not made up for.
    `sleep` blocks: use it on a thread of your own, and `await sleep_async()` in an `async def`.
    """

    def __init__(self, clock: Clock, hz: float) -> None:
        if not 0 < hz < float("inf"):
            raise UsageError(f"a rate must be a positive number of Hz, not {hz}")
        self.period_s = 1 / hz
        self.missed = 0
        self._clock = clock
        self._closed = False
        self._jumped = False  # whether the clock did, so that the time it is due means nothing
        self._wakers: set[Callable[[], object]] = set()
        self._lock = threading.Lock()
        self._due_s = clock.monotonic_s() + self.period_s
        self._simulated = isinstance(clock, SimClock)
        self._leave = clock.on_set(self._on_set) if isinstance(clock, SimClock) else None

    def sleep(self) -> bool:
        """Block until the next period begins; False when the node is closed."""
        woken = Wakeup()
        self._add(woken.set)
        try:
            while (left_s := self._left_s()) > 0:
                woken.wait(None if self._simulated else left_s)
        finally:
            self._discard(woken.set)
        return self._step()

    async def sleep_async(self) -> bool:
        """The same for coroutines."""
        loop, woken = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(woken.set)

        self._add(wake)
        try:
            while (left_s := self._left_s()) > 0:
                try:
                    async with asyncio.timeout(None if self._simulated else left_s):
                        await woken.wait()
                except TimeoutError:
                    continue
                woken.clear()
        finally:
            self._discard(wake)
        return self._step()

    def reset(self) -> None:
        """Begin a full period now."""
        self._due_s = self._clock.monotonic_s() + self.period_s

    def close(self) -> None:
        """End every sleep."""
        self._closed = True
        if self._leave is not None:
            self._leave()
        self._wake()

    def _left_s(self) -> float:
        if self._jumped:
            self._jumped = False
            self.reset()
        return 0.0 if self._closed else self._due_s - self._clock.monotonic_s()

    def _step(self) -> bool:
        """The next period begins where this one ended, or later where whole ones were missed."""
        missed = max(0, int((self._clock.monotonic_s() - self._due_s) / self.period_s))
        self.missed += missed
        self._due_s += (missed + 1) * self.period_s
        return not self._closed

    def _on_set(self, jumped: bool) -> None:
        self._jumped = self._jumped or jumped
        self._wake()

    def _add(self, waker: Callable[[], object]) -> None:
        with self._lock:
            self._wakers.add(waker)

    def _discard(self, waker: Callable[[], object]) -> None:
        with self._lock:
            self._wakers.discard(waker)

    def _wake(self) -> None:
        with self._lock:
            wakers = list(self._wakers)
        for waker in wakers:
            waker()
