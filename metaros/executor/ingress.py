"""The one crossing from Zenoh's threads to an executor.

Zenoh calls `ingress.put`, a C function, with whatever arrives; nothing of ours runs on its threads. `collect` sorts
what came into the mailboxes: the executor does it between callbacks. While it is stuck in a long callback, or nobody
spins, a relief thread does it, so that every backlog stays within its mailbox's bounds.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from queue import Empty, SimpleQueue
from typing import Any, Final

from metaros.executor.mailbox import Mailbox

__all__ = ["Ingress"]

_RELIEF_MIN_S: Final = 0.01  # while samples flow: what arrives in so long is the overshoot of the bounds
_RELIEF_MAX_S: Final = 0.16  # while nothing does


class Ingress:
    """A queue of arrivals, the table that says whose they are, and the list of mailboxes with work.

    An arrival is either an item with a `key_expr` that the table knows, or a pair `(mailbox, item)`, or None, which
    only wakes the executor.
    """

    def __init__(self, *, name: str = "metaros-relief") -> None:
        self.queue: SimpleQueue[Any] = SimpleQueue()
        self.put = self.queue.put
        self.owner = threading.Lock()  # held by the executor that spins
        self.unrouted = 0
        self.async_work = False  # whether some callback is an `async def`
        self._routes: dict[Hashable, tuple[Mailbox, ...]] = {}
        self._ready: list[Mailbox] = []
        self._lock = threading.Lock()
        self._collected = 0
        self._waiting = False  # whether the executor is taking an item: then nobody else may, or order is lost
        self._stop = threading.Event()
        self._relief: threading.Thread | None = None
        self._name = name

    # -- wiring ----------------------------------------------------------------------------------------------------

    def route(self, key: Hashable, mailbox: Mailbox) -> None:
        """Deliver items of this key to the mailbox, too."""
        with self._lock:
            self._routes[key] = (*self._routes.get(key, ()), mailbox)
            self._start_relief()

    def unroute(self, key: Hashable, mailbox: Mailbox) -> bool:
        """The reverse of `route`; True when nobody is left on the key."""
        with self._lock:
            rest = tuple(box for box in self._routes.pop(key, ()) if box is not mailbox)
            if rest:
                self._routes[key] = rest
            return not rest

    def put_to(self, mailbox: Mailbox) -> Callable[[Any], None]:
        """A sink for items without a key of their own in the table."""
        with self._lock:
            self._start_relief()
        put = self.put
        return lambda item: put((mailbox, item))

    def offer(self, mailbox: Mailbox) -> None:
        """Say that something was appended to the mailbox's `pending` from outside."""
        with self._lock:
            if mailbox.queued:
                return
            mailbox.queued = True
            self._ready.append(mailbox)
        self.put(None)

    def wake(self) -> None:
        """Make a waiting executor look around."""
        self.put(None)

    def close(self) -> None:
        """End the relief thread."""
        self._stop.set()
        if self._relief is not None and self._relief is not threading.current_thread():
            self._relief.join()
        self.wake()

    # -- moving ----------------------------------------------------------------------------------------------------

    def wait(self, timeout_s: float | None) -> bool:
        """Block until something arrived (then it is collected) or the time is over."""
        with self._lock:
            self._waiting = True
        try:
            first = self.queue.get(True, timeout_s)
        except Empty:
            self._waiting = False
            return False
        with self._lock:
            self._waiting = False
            self._sort([first, *self._arrived()])
        return True

    def collect(self) -> None:
        """Sort everything that has arrived into the mailboxes, without waiting."""
        with self._lock:
            if not self._waiting:
                self._sort(self._arrived())

    def _arrived(self) -> list[Any]:
        get = self.queue.get
        return [get() for _ in range(self.queue.qsize())]

    def _sort(self, arrivals: list[Any]) -> None:
        self._collected += 1
        routes, touched = self._routes, set()
        for item in arrivals:
            if type(item) is tuple:
                box, item = item
                box.pending.append(item)
                touched.add(box)
            elif item is not None:
                boxes = routes.get(item.key_expr, ())
                for box in boxes:
                    box.pending.append(item)
                touched.update(boxes)
                if not boxes:
                    self.unrouted += 1
        for box in touched:
            box.trim()
            if not box.queued:
                box.queued = True
                self._ready.append(box)

    def take_ready(self) -> list[Mailbox]:
        """The mailboxes with work, in the order in which work came; each is the caller's until it requeues it."""
        with self._lock:
            taken, self._ready = self._ready, []
            return taken

    def requeue(self, mailbox: Mailbox) -> None:
        """Give a mailbox back: it stays on the list while it has work that may run."""
        with self._lock:
            # First the flag, then the look: whoever appends then looks at the flag, and one of the two sees the other.
            mailbox.queued = False
            if mailbox.pending and not mailbox.busy:
                mailbox.queued = True
                self._ready.append(mailbox)

    @property
    def has_ready(self) -> bool:
        """Whether some mailbox has work."""
        return bool(self._ready)

    # -- relief ----------------------------------------------------------------------------------------------------

    def _start_relief(self) -> None:
        if self._relief is None and not self._stop.is_set():
            self._relief = threading.Thread(target=self._relieve, name=self._name, daemon=True)
            self._relief.start()

    def _relieve(self) -> None:
        pause_s = _RELIEF_MIN_S
        seen = self._collected
        while not self._stop.wait(pause_s):
            stuck = self._collected == seen
            if stuck and not self.queue.empty():
                self.collect()
            pause_s = min(pause_s * 2, _RELIEF_MAX_S) if seen == self._collected else _RELIEF_MIN_S
            seen = self._collected
