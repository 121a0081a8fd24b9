"""The mailboxes with work of one executor, and who spins: what an ingress knows of the executors that it serves."""

from __future__ import annotations

import threading
import time
from typing import Final

from metaros.concurrency.waiting import Wakeup
from metaros.executor.mailbox import Mailbox

__all__ = ["Ownership", "ReadyQueue"]

_LOOKS_S: Final = 0.001  # an executor that asked for work so long ago, at most, is not late
_LOOKS_AMID_S: Final = 0.005  # the same amid a flood, where the system gives its threads in turn a few milliseconds
_FLOOD: Final = 64  # items beyond the depth of their mailbox


class Ownership:
    """Which threads spin, so that a blocking call can tell that it would wait for itself."""

    def __init__(self) -> None:
        self._threads: dict[ReadyQueue, int] = {}

    def begin(self, ready_queue: ReadyQueue) -> None:
        """The calling thread spins the nodes of this ready queue."""
        self._threads[ready_queue] = threading.get_ident()

    def end(self, ready_queue: ReadyQueue) -> None:
        """It spins no more."""
        self._threads.pop(ready_queue, None)

    @property
    def is_mine(self) -> bool:
        """Whether the calling thread is the only one that spins nodes of the context."""
        return list(self._threads.values()) == [threading.get_ident()]


class ReadyQueue:
    """The mailboxes with work of one executor's nodes. Guarded by its ingress's lock; one thread waits on it."""

    __slots__ = ("__weakref__", "asleep", "ingress", "looked_s", "ready", "signal", "woken")

    def __init__(self) -> None:
        self.ingress: object = None  # where it is registered
        self.ready: list[Mailbox] = []
        self.looked_s = 0.0  # when its executor last asked for work
        self.woken = False  # whether it was told to look around since it last waited
        self.asleep = False  # whether its thread waits on `signal`, while another leads
        self.signal = Wakeup()

    def wake(self) -> None:
        """End its sleep."""
        if self.asleep:
            self.asleep = False
            self.signal.set()

    def looking_s(self, excess: int, *, waits: bool) -> float | None:
        """The time where its executor waits for work, or asked for some a moment ago; None: it is in a callback."""
        now_s = time.monotonic()
        if waits or self.asleep:
            return now_s
        return now_s if now_s - self.looked_s < (_LOOKS_S if excess < _FLOOD else _LOOKS_AMID_S) else None
