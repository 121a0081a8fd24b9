"""Threads for plain execute callbacks: at most so many, none while there is nothing to do, none waited for at exit."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable

__all__ = ["Workers"]

Job = Callable[[], None]


class Workers:
    """Runs jobs on up to `count` threads; others wait in order. Jobs must not raise. Thread-safe."""

    def __init__(self, count: int, *, name: str) -> None:
        self._count = count
        self._name = name
        self._lock = threading.Lock()
        self._jobs: deque[Job] = deque()
        self._numbers = itertools.count(1)
        self.running = 0

    def submit(self, job: Job) -> None:
        """Run it as soon as a thread is free."""
        with self._lock:
            self._jobs.append(job)
            if self.running >= self._count:
                return
            self.running += 1
        # Daemons: a callback that never returns must not keep the interpreter from exiting.
        threading.Thread(target=self._run, name=f"{self._name}-{next(self._numbers)}", daemon=True).start()

    def withdraw(self, job: Job) -> bool:
        """Take back a job that has not begun; False when it has."""
        with self._lock:
            if job not in self._jobs:
                return False
            self._jobs.remove(job)
            return True

    def clear(self) -> None:
        """Forget the jobs that have not begun."""
        with self._lock:
            self._jobs.clear()

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._jobs:
                    self.running -= 1
                    return
                job = self._jobs.popleft()
            job()
