"""The signals that ask a program to end, on every platform.

POSIX has SIGINT, SIGTERM and SIGHUP (its terminal was closed). On Windows a parent asks with Ctrl-Break, which
arrives as SIGBREAK, and asyncio's loop takes no signal handlers: there a plain handler wakes the loop.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from types import FrameType

__all__ = ["on_stop", "stop_signals"]


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
