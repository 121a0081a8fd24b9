"""Wait for a condition of a real system under test, with a deadline instead of a guess."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable


def wait_until(condition: Callable[[], object], *, timeout_s: float = 60.0, every_s: float = 0.01) -> None:
    """Return as soon as `condition()` is true; fail the test after `timeout_s`."""
    pause = threading.Event()
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"not so within {timeout_s} s: {condition}")
        pause.wait(every_s)


async def wait_until_async(condition: Callable[[], object], *, timeout_s: float = 60.0, every_s: float = 0.01) -> None:
    """The same inside an event loop."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"not so within {timeout_s} s: {condition}")
        await asyncio.sleep(every_s)
