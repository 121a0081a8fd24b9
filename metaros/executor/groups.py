"""Callback groups: which callbacks may run at the same time. They matter where an executor has several threads."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, Final

__all__ = ["CallbackGroup", "MutuallyExclusiveCallbackGroup", "ReentrantCallbackGroup"]

REENTRANT_COROUTINES: Final = 64  # coroutines of one callback that may be under way; further items wait in its mailbox


class CallbackGroup:
    """Something that a callback enters before it runs and leaves when it is done, `async def` included.

    `overlap` is how many coroutines of one `async def` callback may be under way at a time.
    """

    overlap: int = 1

    def enter(self, job: Any) -> bool:
        """Whether the job may run now; where not, the group keeps it and `leave` gives it out in its turn."""
        raise NotImplementedError

    def leave(self) -> Any:
        """One that entered is done; returns the job that has entered in its place, or None."""
        raise NotImplementedError


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Callbacks of this group run one at a time. Each node has one of its own for callbacks without a group."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._taken = False
        self._waiting: deque[Any] = deque()  # at most one job a mailbox or timer: they do not queue twice

    def enter(self, job: Any) -> bool:
        """True when the group was free."""
        with self._lock:
            if self._taken:
                self._waiting.append(job)
                return False
            self._taken = True
            return True

    def leave(self) -> Any:
        """The next in line, or None."""
        with self._lock:
            if self._waiting:
                return self._waiting.popleft()
            self._taken = False
            return None


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks of this group run whenever a thread is free, several calls of the same callback at once included."""

    overlap = REENTRANT_COROUTINES

    def enter(self, job: Any) -> bool:
        """Always."""
        return True

    def leave(self) -> Any:
        """Nobody waits."""
        return None
