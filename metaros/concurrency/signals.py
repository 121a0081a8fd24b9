"""The signals that ask a program to end, on every platform.

POSIX has SIGINT, SIGTERM and SIGHUP (its terminal was closed). On Windows a parent asks with Ctrl-Break, which
arrives as SIGBREAK, and asyncio's loop takes no signal handlers: there a plain handler wakes the loop.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING

from metaros.concurrency.waiting import Wakeup

if TYPE_CHECKING:
    import asyncio

__all__ = ["StopEvent", "on_stop", "stop_signals"]


class StopEvent(threading.Event):
    """An event that a signal's handler may set.

    Python's own takes a lock to be set and to be waited for: a handler that interrupts the main thread where it holds
    that lock would wait for ever. A `Wakeup` takes none.
    """

    def __init__(self) -> None:
        super().__init__()
        self._stopped = False
        self._wakeup = Wakeup()

    def is_set(self) -> bool:
        """Whether it was set."""
        return self._stopped

    def set(self) -> None:
        """Wake who waits, now and later."""
        self._stopped = True
        self._wakeup.set()

    def clear(self) -> None:
        """Not for this one: who was asked to stop stops."""
        raise NotImplementedError

    def wait(self, timeout: float | None = None) -> bool:
        """Whether it is set by then."""
        if not self._stopped and self._wakeup.wait(timeout):
            self._wakeup.set()  # for the next who waits
        return self._stopped


def stop_signals(*, hangup: bool = False) -> tuple[signal.Signals, ...]:
    """Those of SIGINT, SIGTERM, SIGBREAK (and with `hangup` SIGHUP) that this platform has."""
    names = ("SIGINT", "SIGTERM", "SIGBREAK", *(("SIGHUP",) if hangup else ()))
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


def on_stop(loop: asyncio.AbstractEventLoop, callback: Callable[[], object], *, hangup: bool = False) -> None:
    """Call `callback()` on the loop when the program is asked to end. Call it on the main thread."""
    for number in stop_signals(hangup=hangup):
        try:
            loop.add_signal_handler(number, callback)
        except NotImplementedError:  # Windows
            signal.signal(number, _waker(loop, callback))


def _waker(loop: asyncio.AbstractEventLoop, callback: Callable[[], object]) -> Callable[[int, FrameType | None], None]:
    def wake(number: int, frame: FrameType | None) -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(callback)

    return wake
