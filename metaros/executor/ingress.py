"""The one crossing from Zenoh's threads to the executors.

Zenoh calls `ingress.put`, a C function, with whatever arrives; no Python of ours runs on its threads. `collect` sorts
what came into the mailboxes: the executor does it between callbacks. While it is stuck in a long callback, or nobody
spins, a relief thread does it, so that every backlog stays within its mailbox's bounds.

Several executors may serve nodes of one context. Each has a desk; a mailbox with work goes to the desk that claimed its
node. Of the executors that wait, one leads: it waits on the queue, sorts for all and wakes whom it concerns. One that
leaves to run callbacks hands the lead on.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Collection, Hashable, Iterable
from queue import Empty, SimpleQueue
from typing import Any, Final

from metaros.errors import UsageError
from metaros.executor.mailbox import Mailbox
from metaros.sinks import Parcel, parcel_to
from metaros.waiting import Wakeup

__all__ = ["Desk", "Ingress", "Ownership"]

_RELIEF_MIN_S: Final = 0.01  # while samples flow: what arrives in so long is the overshoot of the bounds
_RELIEF_MAX_S: Final = 0.16  # while nothing does


class Ownership:
    """Which threads spin, so that a blocking call can tell that it would wait for itself."""

    def __init__(self) -> None:
        self._threads: dict[Desk, int] = {}

    def begin(self, desk: Desk) -> None:
        """The calling thread spins this desk."""
        self._threads[desk] = threading.get_ident()

    def end(self, desk: Desk) -> None:
        """It spins no more."""
        self._threads.pop(desk, None)

    @property
    def is_mine(self) -> bool:
        """Whether the calling thread is the only one that spins nodes of the context."""
        return list(self._threads.values()) == [threading.get_ident()]


class Desk:
    """Where the mailboxes with work of one executor's nodes lie. Guarded by its ingress's lock; one thread waits."""

    __slots__ = ("__weakref__", "asleep", "ingress", "ready", "signal", "woken")

    def __init__(self) -> None:
        self.ingress: Ingress | None = None  # where it is registered
        self.ready: list[Mailbox] = []
        self.woken = False  # whether it was told to look around since it last waited
        self.asleep = False  # whether its thread waits on `signal`, while another leads
        self.signal = Wakeup()

    def rouse(self) -> None:
        """End its sleep."""
        if self.asleep:
            self.asleep = False
            self.signal.set()


class Ingress:
    """A queue of arrivals, the table that says whose they are, and the list of mailboxes with work.

    An arrival is either an item with a `key_expr` that the table knows, or a parcel for a mailbox, or None, which only
    wakes the executors.
    """

    def __init__(self, *, name: str = "metaros-relief") -> None:
        self.queue: SimpleQueue[Any] = SimpleQueue()
        self.put = self.queue.put
        self.owner = Ownership()
        self.unrouted = 0
        self.async_work = False  # whether some callback is an `async def`
        self._routes: dict[Hashable, tuple[Mailbox, ...]] = {}
        self._desks: dict[object, Desk] = {}  # by node
        self._unclaimed = Desk()
        self._open: weakref.WeakSet[Desk] = weakref.WeakSet()
        self._due_s: float | None = None  # when the leader's wait is over, if by time
        self._leader: Desk | None = None  # whose thread is taking an item: then nobody else may, or order is lost
        self._lock = threading.Lock()
        self._collected = 0
        self._stop = threading.Event()
        self._relief: threading.Thread | None = None
        self._name = name
        self._chores: tuple[Callable[[], None], ...] = ()

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
        """A sink, a C function, for items without a key of their own in the table."""
        with self._lock:
            self._start_relief()
        return parcel_to(mailbox, self.put)

    def offer(self, mailbox: Mailbox) -> None:
        """Say that something was appended to the mailbox's `pending` from outside."""
        with self._lock:
            if mailbox.queued:
                return
            mailbox.queued = True
            desk = self._desks.get(mailbox.owner, self._unclaimed)
            desk.ready.append(mailbox)
            self._nudge(desk)

    def also(self, chore: Callable[[], None]) -> None:
        """Have the relief thread call this several times a second; it must be quick and not raise."""
        with self._lock:
            self._chores = (*self._chores, chore)
            self._start_relief()

    def wake(self) -> None:
        """Make the executors that wait look around. Takes no lock: signal handlers may call it."""
        self.put(None)

    def close(self) -> None:
        """End the relief thread."""
        self._stop.set()
        if self._relief is not None and self._relief is not threading.current_thread():
            self._relief.join()
        self.wake()

    # -- desks -----------------------------------------------------------------------------------------------------

    def claim(self, desk: Desk, nodes: Collection[object], *, spins: bool = False) -> None:
        """Give these nodes' work to the desk, `spins` by this thread; UsageError when another has one of them."""
        with self._lock:
            desks = self._desks
            for node in nodes:
                if desks.get(node, desk) is not desk:
                    raise UsageError("another executor is spinning this node; a node has one executor at a time")
            for node in nodes:
                desks[node] = desk
            if desk.ingress is not self:
                self._register(desk)
            if spins:
                self.owner.begin(desk)
            if self._unclaimed.ready:
                self._move(self._unclaimed, desk, nodes)

    def _register(self, desk: Desk) -> None:
        desk.ingress = self
        self._open.add(desk)

    def release(self, desk: Desk, nodes: Collection[object], *, spins: bool = False) -> None:
        """The reverse of `claim`; what waits goes to the next who claims the nodes."""
        with self._lock:
            if spins:
                self.owner.end(desk)
            for node in nodes:
                if self._desks.get(node) is desk:
                    del self._desks[node]
            if desk.ready:
                self._move(desk, self._unclaimed, nodes)

    @staticmethod
    def _move(source: Desk, target: Desk, nodes: Collection[object]) -> None:
        boxes, source.ready = source.ready, []
        for box in boxes:
            (target if box.owner in nodes else source).ready.append(box)

    def _nudge(self, desk: Desk) -> None:
        """End the desk's wait, if it waits."""
        if desk is self._leader:
            self.put(None)
        else:
            desk.rouse()

    def _promote(self) -> None:
        """Let one of those that sleep lead, where nobody does."""
        if self._leader is None:
            for desk in self._open:
                if desk.asleep:
                    desk.rouse()
                    return

    # -- moving ----------------------------------------------------------------------------------------------------

    def wait(self, desk: Desk, timeout_s: float | None) -> None:
        """Block until the desk has work or was told to look around, or until the time is over."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        try:
            while True:
                with self._lock:
                    if desk.ready or desk.woken or (timeout_s is not None and timeout_s < 0):
                        return
                    lead = self._leader is None or self._leader is desk
                    if lead:
                        self._leader = desk
                    else:
                        desk.asleep = True
                        if desk.ingress is not self:
                            self._register(desk)
                if not (self._lead(timeout_s, deadline_s) if lead else desk.signal.wait(timeout_s)):
                    return
                if deadline_s is not None:
                    timeout_s = deadline_s - time.monotonic()
        finally:
            with self._lock:
                desk.woken = desk.asleep = False
                if self._leader is desk:
                    self._leader = None
                self._promote()

    def _lead(self, timeout_s: float | None, deadline_s: float | None) -> bool:
        """Sort what arrives next, and whatever came with it; False when nothing did.

        Such a queue may wait for ever, see `metaros.waiting`, and no other one has a `put` that is a C function. Two
        things prevent that: it has tried to take its lock before its time counts, so that it does wait; and where a
        signal's handler outlived that wait, the relief thread ends it.
        """
        get = self.queue.get
        try:
            try:
                first = get(False)
            except Empty:
                self._due_s = deadline_s
                first = get(True, timeout_s)
        except Empty:
            return False
        finally:
            self._due_s = None
        with self._lock:
            self._sort([first, *self._arrived()])
        return True

    def collect(self) -> None:
        """Sort everything that has arrived into the mailboxes, without waiting."""
        with self._lock:
            if self._leader is None:
                self._sort(self._arrived())

    def _arrived(self) -> list[Any]:
        get = self.queue.get
        return [get() for _ in range(self.queue.qsize())]

    def _sort(self, arrivals: Iterable[Any]) -> None:
        self._collected += 1
        routes, touched = self._routes, set()
        boxes: tuple[Mailbox, ...] = ()
        key: Hashable = None  # of the item before: runs of one key are looked up once
        for item in arrivals:
            if type(item) is Parcel:
                box = item.start
                box.pending.append(item.stop)
                touched.add(box)
            elif item is not None:
                if (found := item.key_expr) != key:
                    key, boxes = found, routes.get(found, ())
                    touched.update(boxes)
                for box in boxes:
                    box.pending.append(item)
                if not boxes:
                    self.unrouted += 1
            else:
                for desk in self._open:
                    desk.woken = True
                    desk.rouse()
        for box in touched:
            box.trim()
            if not box.queued:
                box.queued = True
                desk = self._desks.get(box.owner, self._unclaimed)
                desk.ready.append(box)
                desk.rouse()

    def take_ready(self, desk: Desk) -> list[Mailbox]:
        """The desk's mailboxes with work, in the order in which it came; each is the caller's until it requeues it."""
        if not desk.ready:
            return []
        with self._lock:
            taken, desk.ready = desk.ready, []
            return taken

    def requeue(self, mailbox: Mailbox, *, nudge: bool = False) -> None:
        """Give a mailbox back: it stays on its desk while it has work that may run. `nudge` ends the desk's wait."""
        with self._lock:
            # First the flag, then the look: whoever appends then looks at the flag, and one of the two sees the other.
            mailbox.queued = False
            if mailbox.pending and not mailbox.busy:
                mailbox.queued = True
                desk = self._desks.get(mailbox.owner, self._unclaimed)
                desk.ready.append(mailbox)
                if nudge:
                    self._nudge(desk)

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
            due_s = self._due_s
            if due_s is not None and time.monotonic() > due_s:
                self.put(None)
            for chore in self._chores:
                chore()
            pause_s = min(pause_s * 2, _RELIEF_MAX_S) if seen == self._collected else _RELIEF_MIN_S
            seen = self._collected
