"""An executor's agenda: what is ready to run, in turns, gathered from its nodes when it is empty."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from typing import Any, Final

from metaros.executor import Ingress, Mailbox
from metaros.executor.ready_queue import ReadyQueue
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle
from metaros.ros2.rclpy.execution.inbox import InboxMail
from metaros.ros2.rclpy.execution.task import Task
from metaros.ros2.rclpy.execution.wait_set import WaitSet
from metaros.ros2.rclpy.execution.work import GuardWork, MailWork, NativeTimerWork, TimerWork, WaitableWork, Work

__all__ = ["Agenda"]

_PATIENT_POLLS: Final = 16  # so often a coroutine that only yields is run again at once
_POLL_S: Final = 0.001  # then so often
_GROUP_S: Final = 0.1  # how often a group that let nothing run is asked again, besides when one of its callbacks ends


class Agenda:
    """`gather` looks around, `pop` gives out. Thread-safe; mailboxes are the agenda's until somebody has run them.

    Of the tasks of a round the newest are run first, as rclpy does, unless `newest_first` is off.
    """

    def __init__(self) -> None:
        self.newest_first = True
        self._tasks: deque[Task[Any]] = deque()
        self._polls: deque[Task[Any]] = deque()  # those that yielded time and again, and wait a little
        self._poll_s = 0.0  # until then
        self.queue = ReadyQueue()
        self.due_s: float | None = None  # when the next may become ready by itself, as of the last look; monotonic
        self._lock = threading.RLock()
        self.entries: deque[Work | Task[Any]] = deque()  # what `pop` gives out; others only ask whether there is any
        self._parked: list[Mailbox] = []  # with items, while their group is busy
        self._tasks_came = False  # alone, the last time
        self._asks = False  # whether a waitable or a group must be asked again, as neither tells of itself
        self._handed: dict[
            int, Work
        ] = {}  # by the id of sources that handlers will run, which are not given out meanwhile
        self._nodes: dict[Any, Any] = {}  # by the library's node behind it

    # -- nodes -----------------------------------------------------------------------------------------------------

    def add(self, node: Any) -> None:
        """Run this node's work, too."""
        with self._lock:
            self._nodes = {**self._nodes, node.handle: node}

    def remove(self, node: Any) -> Any:
        """Run it no more; the library's node behind it, None where it was not here."""
        with self._lock:
            for handle, member in self._nodes.items():
                if member is node:
                    self._nodes = {other: rest for other, rest in self._nodes.items() if other is not handle}
                    self._give_back(lambda work: work.node is node)
                    return handle
        return None

    @property
    def handles(self) -> Collection[Any]:
        """The library's nodes."""
        return self._nodes.keys()

    def ingress(self) -> Ingress | None:
        """Where arrivals for the nodes come in; None without nodes."""
        for handle in self._nodes:
            ingress: Ingress = handle.ingress
            return ingress
        return None

    # -- tasks -----------------------------------------------------------------------------------------------------

    def add_task(self, task: Task[Any]) -> None:
        """Run it in the next round, or a little later where it does nothing but yield. From any thread."""
        if task.polls <= _PATIENT_POLLS:
            self._tasks.append(task)
            return
        if not self._polls:
            self._poll_s = time.monotonic() + _POLL_S
        self._polls.append(task)

    # -- giving out ------------------------------------------------------------------------------------------------

    def pop(self, nodes: Collection[Any] | None = None) -> Work | Task[Any] | None:
        """The next that may run now, of these nodes or of all; None where nothing may."""
        if not self.entries:
            return None
        with self._lock:
            for _ in range(len(self.entries)):
                entry = self.entries.popleft()
                if isinstance(entry, Task):
                    node = getattr(entry, "node", None)  # that of its entity
                    if node is None or node in (self._nodes.values() if nodes is None else nodes):
                        return entry
                    self.entries.append(entry)
                elif not entry.ready() or entry.node not in self._nodes.values():
                    entry.give_back()
                elif not entry.allowed():
                    if isinstance(entry, MailWork):
                        self._parked.append(entry.source)
                elif nodes is None or entry.node in nodes:
                    return entry
                else:
                    self.entries.append(entry)
        return None

    def put_back(self, work: Work) -> None:
        """Give it out later."""
        self.entries.append(work)

    def hand(self, work: Work, wake: Callable[[], None]) -> None:
        """Somebody will run it: its source is not ready again until the work is `taken`, which calls `wake()`."""
        self._handed[id(work.source)] = work

        def taken() -> None:
            if self._handed.pop(id(work.source), None) is not None:
                wake()

        work.taken = taken

    def holds(self, work: Work) -> bool:
        """Whether it was handed out, and neither taken nor given back meanwhile."""
        return self._handed.get(id(work.source)) is work

    # -- looking around --------------------------------------------------------------------------------------------

    def gather(self, executor: Any) -> Work | None:
        """Put what is ready on the agenda, but for the first of it where that is what is to run next.

        Tasks come alone every other time: what they make ready, such as a message, is seen together with all else.
        """
        with self._lock:
            found: list[Work | Task[Any]] = []
            waits: list[float] = []
            if self._tasks or self._polls:
                self._gather_tasks(found, waits)
                self._tasks_came = bool(found) and not self._tasks_came
                if self._tasks_came:
                    self.entries.extend(found)
                    self.due_s = time.monotonic()  # look again at once
                    return None
            else:
                self._tasks_came = False
            self._asks = False
            mail = self._take_mail()  # first: what is run now must be there when waitables are asked
            try:
                self._gather_the_rest(executor, found, waits)
            except BaseException:  # of somebody's waitable or group, or Ctrl-C: the mail waits for the next look
                self._parked = mail + self._parked
                raise
            self._gather_mail(mail, found, waits)
            self.due_s = time.monotonic() + min(waits) if waits else None
            if not found:
                return None
            first = found[0]
            if self.entries or isinstance(first, Task):
                self.entries.extend(found)
                return None
            self.entries.extend(found[1:])
            return first

    def _gather_the_rest(self, executor: Any, found: list[Work | Task[Any]], waits: list[float]) -> None:
        """Waitables, timers and guard conditions."""
        for handle, node in self._nodes.items():
            for waitable in node.waitables:
                if not getattr(waitable, "_by_mail", False):
                    self._asks = True
                    self._gather_waitables(node, executor, found, waits)
                    break
            self._gather_timers(handle, node, found, waits)
            for guard in node.guards:
                if guard.handle.triggered and id(guard) not in self._handed:
                    self._choose(GuardWork(guard, guard.callback_group, node), found, waits)

    def gather_timers(self) -> None:
        """Put those that became due first on the agenda."""
        with self._lock:
            found: list[Work | Task[Any]] = []
            waits: list[float] = []
            for handle, node in self._nodes.items():
                self._gather_timers(handle, node, found, waits)
            self.entries.extendleft(reversed(found))
            self.due_s = time.monotonic() + min(waits) if waits else None

    def _choose(self, work: Work, found: list[Any], waits: list[float]) -> bool:
        """Take it where its group lets it run, else look again soon: no group has to tell when it does."""
        if work.allowed():
            found.append(work)
            return True
        waits.append(_GROUP_S)
        self._asks = True
        return False

    def _gather_tasks(self, found: list[Work | Task[Any]], waits: list[float]) -> None:
        if self._polls:
            left_s = self._poll_s - time.monotonic()
            if left_s <= 0:
                self._tasks.extendleft([self._polls.popleft() for _ in range(len(self._polls))])
            else:
                waits.append(left_s)
        count = len(self._tasks)
        if count:
            round_of = [self._tasks.popleft() for _ in range(count)]
            found.extend(reversed(round_of) if self.newest_first else round_of)

    def _gather_timers(self, handle: Any, node: Any, found: list[Work | Task[Any]], waits: list[float]) -> None:
        for timer in node.timers:
            state = timer.handle
            left_ns = state.time_until_next_call()
            if left_ns is None:
                continue
            if left_ns > 0:
                if state.clock.runs:
                    waits.append(left_ns / 1e9)
            elif id(timer) not in self._handed:
                self._choose(TimerWork(timer, timer.callback_group, node), found, waits)
        own = handle.timers
        due_s = own.next_due_s()
        if due_s is None:
            return
        now_s = own.now_s()
        while (due := own.pop_due(now_s)) is not None:  # each once: what is due again meanwhile comes the next time
            found.append(NativeTimerWork(due, None, node))
        due_s = own.next_due_s()
        if due_s is not None and not own.paused:
            waits.append(due_s - now_s)

    def _gather_waitables(self, node: Any, executor: Any, found: list[Work | Task[Any]], waits: list[float]) -> None:
        asked = []
        wait_set = WaitSet()
        for waitable in [waitable for waitable in node.waitables if not getattr(waitable, "_by_mail", False)]:
            work = WaitableWork(waitable, node, executor)
            if id(waitable) not in self._handed and self._choose(work, [], waits):
                try:
                    with waitable:
                        waitable.get_num_entities()
                        waitable.add_to_wait_set(wait_set)
                except InvalidHandle:  # what it waits for was destroyed
                    continue
                asked.append(work)
        patience_s = wait_set.look()
        if patience_s is not None:
            waits.append(patience_s)
        found.extend(work for work in asked if work.source.is_ready(wait_set))

    def next_mail(self) -> MailWork | None:
        """The one mailbox with items, where that is plainly next: no tasks, nothing to be asked, nothing that waits.

        Whoever asks knows that no timer is due, and that nobody said that anything else became ready.
        """
        with self._lock:
            queue = self.queue
            if self._tasks or self._polls or self._parked or self._asks or queue.woken:
                return None
            ingress = self.ingress()
            if ingress is None:
                return None
            ingress.collect()
            if len(queue.ready) != 1 or type(queue.ready[0]) is InboxMail:
                return None
            mailbox, *others = ingress.take_ready(queue)
            for other in others:  # it came this very moment
                ingress.requeue(other)
            node: Any = self._nodes.get(mailbox.owner)
            if node is None or not mailbox.pending or mailbox.busy:
                ingress.requeue(mailbox)
                return None
            work = MailWork(mailbox, mailbox.group, node)
            if work.allowed():
                return work
            self._parked.append(mailbox)
            return None

    def _take_mail(self) -> list[Mailbox]:
        """The mailboxes with items, those that waited for their group first."""
        ingress = self.ingress()
        if ingress is None:
            return []
        ingress.collect()
        parked, self._parked = self._parked, []
        return parked + ingress.take_ready(self.queue)

    def _gather_mail(self, mail: list[Mailbox], found: list[Work | Task[Any]], waits: list[float]) -> None:
        late: list[Any] = []  # responses: as in rclpy after messages that came with them
        for mailbox in mail:
            node: Any = self._nodes.get(mailbox.owner)
            if node is None or not mailbox.pending or mailbox.busy:
                mailbox.owner.ingress.requeue(mailbox)  # type: ignore[attr-defined]
                continue
            work = MailWork(mailbox, mailbox.group, node)
            if not work.allowed():
                waits.append(_GROUP_S)
                self._parked.append(mailbox)
            elif type(mailbox) is InboxMail:
                late.append(work)
            else:
                found.append(work)
        if late:
            found.extend(late)

    # -- the end ---------------------------------------------------------------------------------------------------

    def clear(self) -> None:
        """Give back everything."""
        with self._lock:
            self._nodes = {}
            self._give_back(lambda work: True)
            self.entries.clear()
            self._tasks.clear()
            self._polls.clear()

    def _give_back(self, chosen: Callable[[Work], bool]) -> None:
        entries = list(self.entries)
        self.entries.clear()
        for entry in entries:
            if isinstance(entry, Work) and chosen(entry):
                entry.give_back()
            else:
                self.entries.append(entry)
        for work in [work for work in self._handed.values() if chosen(work)]:
            del self._handed[id(work.source)]
            work.give_back()
        parked, self._parked = self._parked, []
        for mailbox in parked:
            mailbox.owner.ingress.requeue(mailbox)  # type: ignore[attr-defined]
