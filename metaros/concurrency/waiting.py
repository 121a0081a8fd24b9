"""Waits that end in time, and that Ctrl-C ends with a KeyboardInterrupt.

Two of Python's own do not always. `SimpleQueue.get` with a timeout waits for ever where its time is over before it has
begun to wait, because its thread was kept off the processor or a signal's handler took so long (CPython up to 3.12: it
counts on with a negative number, which means "no timeout"). A wait for `threading.Event` or a `Condition` may raise
RuntimeError, "release unlocked lock", where Ctrl-C comes as it begins. A lock's `acquire` has neither.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import suppress
from queue import Empty
from typing import Generic, TypeVar

__all__ = ["WaitQueue", "Wakeup", "pause"]

T = TypeVar("T")


class Wakeup:
    """What one thread waits for, and any thread or signal handler sets: the wait takes it back."""

    __slots__ = ("_lock",)

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()

    def set(self) -> None:
        """End the wait, or the next one. Takes no lock, as handlers may interrupt a wait anywhere."""
        with suppress(RuntimeError):  # it was set already
            self._lock.release()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Whether it was set by then; without a timeout it always was."""
        return self._lock.acquire(timeout=-1 if timeout_s is None else min(max(0.0, timeout_s), threading.TIMEOUT_MAX))


class WaitQueue(Generic[T]):
    """A queue without a bound of its own, to which any thread puts and from which one takes."""

    def __init__(self) -> None:
        self._items: deque[T] = deque()
        self._wakeup = Wakeup()

    def put(self, item: T) -> None:
        """Never waits."""
        self._items.append(item)
        self._wakeup.set()

    def get(self, timeout_s: float | None = None) -> T:
        """The oldest item; waits for one, at most so long.

        Raises:
            queue.Empty: none came in time.
        """
        until_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._items:
            if not self._wakeup.wait(None if until_s is None else until_s - time.monotonic()):
                break
        return self.get_nowait()

    def empty(self) -> bool:
        """Whether nothing is there at this moment."""
        return not self._items

    def get_nowait(self) -> T:
        """The oldest item.

        Raises:
            queue.Empty: there is none.
        """
        try:
            return self._items.popleft()
        except IndexError:
            raise Empty from None


def pause(seconds: float) -> None:
    """Sleep; on the main thread Ctrl-C ends it with a KeyboardInterrupt, whenever it comes."""
    time.sleep(max(0.0, seconds))  # noqa: TID251  (nothing else could end it)
