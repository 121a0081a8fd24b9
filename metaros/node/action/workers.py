"""Threads for plain execute callbacks: at most so many, none while there are no goals, none waited for at exit."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable
from typing import Final

from metaros.concurrency.waiting import pause

__all__ = ["Workers"]

Job = Callable[[], None]
_LOOK_S: Final = 0.005


class Workers:
    """Runs jobs on up to `count` threads; others wait in order. Jobs must not raise. Thread-safe.

    A thread that has nothing to do stays for `idle_s`: starting one costs more than a short goal does.
    """

    def __init__(self, count: int, *, name: str, idle_s: float = 1.0) -> None:
        self._count = count
        self._name = name
        self._idle_s = idle_s
        self._changed = threading.Condition()
        self._jobs: deque[Job] = deque()
        self._numbers = itertools.count(1)
        self._idle = 0
        self.running = 0

    def submit(self, job: Job) -> None:
        """Run it as soon as a thread is free."""
        with self._changed:
            self._jobs.append(job)
            if self._idle >= len(self._jobs):
                self._changed.notify()
                return
            if self.running >= self._count:
                return
            self.running += 1
        # Daemons: a callback that never returns must not keep the interpreter from exiting.
        threading.Thread(target=self._run, name=f"{self._name}-{next(self._numbers)}", daemon=True).start()

    def withdraw(self, job: Job) -> bool:
        """Take back a job that has not begun; False when it has."""
        with self._changed:
            if job not in self._jobs:
                return False
            self._jobs.remove(job)
            return True

    def clear(self) -> None:
        """Forget the jobs that have not begun."""
        with self._changed:
            self._jobs.clear()

    def settle(self, timeout_s: float) -> bool:
        """Wait until no job runs; False when some still does."""
        for _ in range(max(1, round(timeout_s / _LOOK_S))):
            if self.running == self._idle:
                return True
            pause(_LOOK_S)
        return self.running == self._idle

    def _run(self) -> None:
        while (job := self._next()) is not None:
            job()

    def _next(self) -> Job | None:
        """The oldest job; None when none came for so long that the thread may end."""
        with self._changed:
            self._idle += 1
            came = self._changed.wait_for(lambda: self._jobs, self._idle_s)
            self._idle -= 1
            if came:
                return self._jobs.popleft()
            self.running -= 1
            return None
