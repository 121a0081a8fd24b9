"""The one queue between Zenoh's threads and the executors.

Zenoh calls `ingress.put`, a C function, with whatever arrives; no Python of ours runs on its threads. `collect` sorts
what came into the mailboxes: the executor does it between callbacks. While it is stuck in a long callback, or nobody
spins, a relief thread does it, so that every backlog stays within its mailbox's bounds.

Several executors may serve nodes of one context. Each has a ready queue; a mailbox with work goes to the ready queue
that claimed its node. Of the executors that wait, one leads: it waits for arrivals, sorts them for all and wakes the
executors concerned. One that leaves to run callbacks hands the lead on.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Collection, Hashable, Iterable
from queue import Empty, SimpleQueue
from typing import Any, Final

from metaros.concurrency.native_callbacks import Addressed, addressed_to
from metaros.errors import UsageError
from metaros.executor.channel_mailbox import POLL_S, ChannelMailbox
from metaros.executor.mailbox import Mailbox
from metaros.executor.ready_queue import Ownership, ReadyQueue

__all__ = ["Ingress"]

_RELIEF_MIN_S: Final = 0.01  # while samples flow: what arrives in so long is the overshoot of the bounds
_RELIEF_MAX_S: Final = 0.16  # while nothing does


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
        self._ready_queues: dict[object, ReadyQueue] = {}  # by node
        self._unclaimed = ReadyQueue()
        self._open: weakref.WeakSet[ReadyQueue] = weakref.WeakSet()
        self._due_s: float | None = None  # when the leader's wait is over, if by time
        self._leader: ReadyQueue | None = None  # whose thread is taking an item: then nobody else may, or order is lost
        self._sleepers = False  # whether anybody may be asleep: most contexts have one executor
        self._lock = threading.Lock()
        self._collected = 0
        self._stop = threading.Event()
        self._relief: threading.Thread | None = None
        self._name = name
        self._chores: tuple[Callable[[], None], ...] = ()
        self._late: set[Mailbox] = set()  # that were let have more than their depth
        self._channelled: set[ChannelMailbox] = set()
        self._polls = False  # whether the relief thread looks into channels whose bells are silent

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
        """A sink, a C function, for items without a key in the table; a bell where channels fill the mailbox."""
        with self._lock:
            self._start_relief()
        return addressed_to(mailbox, self.put)

    def attach(self, mailbox: ChannelMailbox, receive: Callable[[], Any], bell: Callable[[bool], None]) -> None:
        """Fill it from a channel, too: `receive()` is the oldest item or None, `bell(on)` turns the bell on or off."""
        with self._lock:
            mailbox.channels = (*mailbox.channels, receive)
            mailbox.bells = (*mailbox.bells, bell)
            self._channelled.add(mailbox)

    def detach(self, mailbox: ChannelMailbox) -> None:
        """Fill it no more."""
        with self._lock:
            mailbox.channels = mailbox.bells = ()
            self._channelled.discard(mailbox)

    def refill(self, mailbox: ChannelMailbox) -> None:
        """For who takes its items without an executor."""
        with self._lock:
            mailbox.refill()

    def offer(self, mailbox: Mailbox) -> None:
        """Say that something was appended to the mailbox's `pending` from outside."""
        with self._lock:
            self._offer(mailbox)

    def _offer(self, mailbox: Mailbox) -> None:
        if not mailbox.queued:
            mailbox.queued = True
            ready_queue = self._ready_queues.get(mailbox.owner, self._unclaimed)
            ready_queue.ready.append(mailbox)
            self._wake_queue(ready_queue)

    def add_chore(self, chore: Callable[[], None]) -> None:
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

    # -- ready queues ----------------------------------------------------------------------------------------------

    def claim(self, ready_queue: ReadyQueue, nodes: Collection[object], *, spins: bool = False) -> None:
        """Give these nodes' work to the queue, `spins` by this thread; UsageError when another has one of them."""
        with self._lock:
            queues = self._ready_queues
            for node in nodes:
                if queues.get(node, ready_queue) is not ready_queue:
                    raise UsageError("another executor is spinning this node; a node has one executor at a time")
            for node in nodes:
                queues[node] = ready_queue
            ready_queue.ingress = self
            self._open.add(ready_queue)
            if spins:
                self.owner.begin(ready_queue)
            if self._unclaimed.ready:
                self._move(self._unclaimed, ready_queue, nodes)

    def release(self, ready_queue: ReadyQueue, nodes: Collection[object], *, spins: bool = False) -> None:
        """The reverse of `claim`; what waits goes to the next who claims the nodes."""
        with self._lock:
            if spins:
                self.owner.end(ready_queue)
            for node in nodes:
                if self._ready_queues.get(node) is ready_queue:
                    del self._ready_queues[node]
            if ready_queue.ready:
                self._move(ready_queue, self._unclaimed, nodes)

    @staticmethod
    def _move(source: ReadyQueue, target: ReadyQueue, nodes: Collection[object]) -> None:
        boxes, source.ready = source.ready, []
        for box in boxes:
            (target if box.owner in nodes else source).ready.append(box)

    def _wake_queue(self, ready_queue: ReadyQueue) -> None:
        """End the wait of the queue's thread, if it waits."""
        if ready_queue is self._leader:
            self.put(None)
        else:
            ready_queue.wake()

    def _promote(self) -> None:
        """Let one of those that sleep lead."""
        for ready_queue in self._open:
            if ready_queue.asleep:
                ready_queue.wake()
                return
        self._sleepers = False

    # -- moving ----------------------------------------------------------------------------------------------------

    def wait(self, ready_queue: ReadyQueue, timeout_s: float | None) -> None:
        """Block until the queue has work or was woken, or until the time is over."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        try:
            while True:
                with self._lock:
                    if ready_queue.ready or ready_queue.woken or (timeout_s is not None and timeout_s < 0):
                        self._leave(ready_queue)
                        return
                    lead = self._leader is None or self._leader is ready_queue
                    if lead:
                        self._leader = ready_queue
                    else:
                        self._sleepers = ready_queue.asleep = True
                        ready_queue.ingress = self
                        self._open.add(ready_queue)
                if not lead and not ready_queue.signal.wait(timeout_s):
                    timeout_s = -1.0
                elif lead and self._lead(ready_queue, timeout_s, deadline_s):
                    return
                elif deadline_s is not None:
                    timeout_s = deadline_s - time.monotonic()
        except BaseException:
            with self._lock:
                self._leave(ready_queue)
            raise

    def _lead(self, ready_queue: ReadyQueue, timeout_s: float | None, deadline_s: float | None) -> bool:
        """Sort what arrives next, and whatever came with it; True when that ended the wait, or nothing came in time.

        Such a queue may wait for ever, see `metaros.concurrency.waiting`, and no other one has a `put` that is a C
        function. Two things prevent that: it has tried to take its lock before its time counts, so that it does wait;
        and where a signal's handler outlived that wait, the relief thread ends it.
        """
        get = self.queue.get
        try:
            if timeout_s is None:
                arrivals = [get()]
            else:
                try:
                    arrivals = [get(False)]
                except Empty:
                    self._due_s = deadline_s
                    arrivals = [get(True, timeout_s)]
        except Empty:
            arrivals = []
        finally:
            self._due_s = None
        with self._lock:  # once: from here to the callback every step is a part of each message's latency
            if arrivals:
                if self.queue.qsize() or not self._sort_alone(arrivals[0]):
                    arrivals.extend(self._arrived())
                    self._sort(arrivals, looking=True)
                if not ready_queue.ready and not ready_queue.woken:
                    return False
            self._leave(ready_queue)
        return True

    def _leave(self, ready_queue: ReadyQueue) -> None:
        """It waits no more; one of those that sleep leads, where nobody does."""
        ready_queue.woken = ready_queue.asleep = False
        if self._leader is ready_queue:
            self._leader = None
        if self._sleepers and self._leader is None:
            self._promote()

    def collect(self, *, relief: bool = False) -> None:
        """Sort everything that has arrived into the mailboxes, without waiting. `relief`: for executors that do not."""
        if self.queue.empty():
            return
        with self._lock:
            if self._leader is None:
                self._sort(self._arrived(), looking=not relief)

    def _arrived(self) -> list[Any]:
        get = self.queue.get
        return [get() for _ in range(self.queue.qsize())]

    def _sort(self, arrivals: Iterable[Any], *, looking: bool) -> None:
        self._collected += 1
        routes, touched = self._routes, set()
        boxes: tuple[Mailbox, ...] = ()
        key: Hashable = None  # of the item before: runs of one key are looked up once
        for item in arrivals:
            if type(item) is Addressed:
                box = item.start
                if box.channelled:
                    box.rung += 1
                else:
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
                for ready_queue in self._open:
                    ready_queue.woken = True
                    ready_queue.wake()
        for box in touched:
            ready_queue = self._ready_queues.get(box.owner, self._unclaimed)
            if box.channelled:
                box.refill()
                if not box.pending:
                    continue
            elif box.depth is None or len(box.pending) <= box.depth:
                box.trim()
            else:
                waits = ready_queue is self._leader
                box.trim(ready_queue.looking_s(len(box.pending) - box.depth, waits=waits) if looking else None)
                if box.late_s:
                    self._late.add(box)
            if not box.queued:
                box.queued = True
                ready_queue.ready.append(box)
                ready_queue.wake()

    def _sort_alone(self, item: Any) -> bool:
        """Sort what came alone, for one empty mailbox, which then has nothing to trim; False where it is otherwise."""
        if item is None:
            return False
        boxes: tuple[Mailbox, ...]
        if type(item) is Addressed:
            boxes, item = (item.start,), item.stop
        else:
            boxes = self._routes.get(item.key_expr, ())
        if len(boxes) != 1 or (box := boxes[0]).queued or box.pending or box.channelled:
            return False
        box.pending.append(item)
        box.queued = True
        ready_queue = self._ready_queues.get(box.owner, self._unclaimed)
        ready_queue.ready.append(box)
        ready_queue.wake()
        self._collected += 1
        return True

    def take_ready(self, ready_queue: ReadyQueue) -> list[Mailbox]:
        """The queue's mailboxes with work, in the order in which it came; each is the caller's until it requeues it."""
        ready_queue.looked_s = time.monotonic()
        if not ready_queue.ready:
            return []
        with self._lock:
            taken, ready_queue.ready = ready_queue.ready, []
            return taken

    def requeue(self, mailbox: Mailbox, *, wake_executor: bool = False) -> None:
        """Give a mailbox back: it stays queued while it has work that may run. `wake_executor`: end its wait."""
        with self._lock:
            if mailbox.channelled:
                mailbox.refill()  # type: ignore[attr-defined]
            # First the flag, then the look: whoever appends then looks at the flag, and one of the two sees the other.
            mailbox.queued = False
            if mailbox.pending and not mailbox.busy:
                mailbox.queued = True
                ready_queue = self._ready_queues.get(mailbox.owner, self._unclaimed)
                ready_queue.ready.append(mailbox)
                if wake_executor:
                    self._wake_queue(ready_queue)

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
                self.collect(relief=True)
            if self._late or self._channelled:
                self._keep_bounds()
            due_s = self._due_s
            if due_s is not None and time.monotonic() > due_s:
                self.put(None)
            for chore in self._chores:
                chore()
            pause_s = min(pause_s * 2, _RELIEF_MAX_S) if seen == self._collected else _RELIEF_MIN_S
            if self._polls:
                pause_s = POLL_S
            seen = self._collected

    def _keep_bounds(self) -> None:
        """Of mailboxes that an executor filled before it got stuck, and of channels that would hold up their link."""
        now_s = time.monotonic()
        with self._lock:
            late = [box for box in self._late if box.late_s]
            for box in late:
                box.drop_late()
            self._late = {box for box in late if box.late_s}
            for filled in self._channelled:
                if filled.relieve(now_s):
                    self._collected += 1  # more is coming: look again soon
                self._poll(filled)
            changed = [filled for filled in self._channelled if filled.change()]
        for filled in changed:
            filled.ring(filled.polled)
        with self._lock:  # what came before the bell could be heard
            self._polls = False
            for filled in self._channelled:
                self._poll(filled)
                self._polls = self._polls or filled.polled

    def _poll(self, mailbox: ChannelMailbox) -> None:
        """Look into its channels."""
        mailbox.refill()
        if mailbox.pending:
            self._offer(mailbox)
