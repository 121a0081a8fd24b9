"""How many callbacks run at this moment, on which threads, and waiting until none does."""

from __future__ import annotations

import threading
import time

from metaros.concurrency.waiting import Wakeup

__all__ = ["WorkInProgress"]


class WorkInProgress:
    """`with` around each callback. The one thread that spins may set `spinner` instead, which takes no lock, and
    take it back, and then `tell` those who are `waiting`.
    """

    def __init__(self) -> None:
        self.spinner: int | None = None
        self._lock = threading.RLock()
        self._threads: dict[int, int] = {}
        self.waiting: list[Wakeup] = []

    def __enter__(self) -> None:
        thread = threading.get_ident()
        with self._lock:
            self._threads[thread] = self._threads.get(thread, 0) + 1

    def __exit__(self, *_: object) -> None:
        thread = threading.get_ident()
        with self._lock:
            left = self._threads[thread] - 1
            if left:
                self._threads[thread] = left
                return
            del self._threads[thread]
        self.tell()

    def tell(self) -> None:
        """Have those who wait look."""
        for woken in list(self.waiting):
            woken.set()

    def mine(self) -> bool:
        """Whether the calling thread is within one."""
        thread = threading.get_ident()
        return thread in self._threads or thread == self.spinner

    def wait(self, timeout_s: float | None = None) -> bool:
        """Whether all are done by then, but those on the calling thread, which cannot be; None or less: for ever."""
        deadline_s = None if timeout_s is None or timeout_s < 0 else time.monotonic() + timeout_s
        woken = Wakeup()
        self.waiting.append(woken)
        try:
            while self._others():
                left_s = None if deadline_s is None else deadline_s - time.monotonic()
                if (left_s is not None and left_s <= 0) or not woken.wait(left_s):
                    return not self._others()
            return True
        finally:
            self.waiting.remove(woken)

    def _others(self) -> bool:
        me = threading.get_ident()
        with self._lock:
            return self.spinner not in (None, me) or any(thread != me for thread in self._threads)
