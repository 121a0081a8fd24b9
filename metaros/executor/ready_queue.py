"""The mailboxes with work of one executor, and who spins: what an ingress knows of the executors that it serves."""

from __future__ import annotations

import threading

from metaros.concurrency.waiting import Wakeup
from metaros.executor.mailbox import Mailbox

__all__ = ["Ownership", "ReadyQueue"]


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
