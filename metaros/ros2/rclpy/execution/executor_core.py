"""What executors have in common below how they spin: nodes, tasks, the next that is ready, running it, the end."""

from __future__ import annotations

import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Collection, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from metaros.concurrency.waiting import Wakeup
from metaros.errors import UsageError
from metaros.executor import Ingress
from metaros.executor.switch_interval import SWITCH_INTERVAL_S, shorten_switch_interval
from metaros.node import heartbeat
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.utilities import get_default_context
from metaros.ros2.rclpy.execution.agenda import Agenda
from metaros.ros2.rclpy.execution.executor_errors import (
    ConditionReachedException,
    ExternalShutdownException,
    ShutdownException,
    TimeoutException,
    TimeoutObject,
)
from metaros.ros2.rclpy.execution.handler_task import HandlerTask, Waiter
from metaros.ros2.rclpy.execution.progress import WorkInProgress
from metaros.ros2.rclpy.execution.task import Future, Task
from metaros.ros2.rclpy.execution.work import Work

__all__ = ["ExecutorCore", "never", "seconds"]

E = TypeVar("E", bound="ExecutorCore")


def never() -> bool:
    """The condition that ends no wait."""
    return False


class ExecutorCore:
    """An executor that cannot spin yet. `context` is the default one where none is given."""

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__()
        self._context = get_default_context() if context is None else context
        self._nodes: tuple[Any, ...] = ()
        self._agenda = Agenda()
        self._served: Ingress | None = None  # while it spins
        self._pending_tasks: dict[Task[Any], None] = {}  # kept alive until they are over
        self._failures: deque[BaseException] = deque()  # what callbacks on other threads raised
        self._progress = WorkInProgress()
        self._is_shutdown = False
        self._lock = threading.RLock()
        self._depth = 0  # spins within each other, on one thread
        self._spins_on = False  # by `spin`, until the end
        self._thread: int | None = None
        self._stirred = False  # whether it was told to look around since it last did
        self._asleep = False  # from before the last look at what is ready until the end of the wait
        self._waiter = Waiter(self)
        self._wakeup = Wakeup()  # for waits without nodes
        self._callbacks: Iterator[tuple[Task[Any], Any, Any]] | None = None
        self._arguments: tuple[Any, ...] = ()
        stop = self._context.wake_with(self._waiter._wake_up)
        weakref.finalize(self, _abandon, stop, self._agenda).atexit = False

    @property
    def context(self) -> Context:
        """Whose shutdown ends it."""
        return self._context

    @property
    def is_spinning(self) -> bool:
        """Whether a thread spins it."""
        return self._depth > 0

    # -- nodes -----------------------------------------------------------------------------------------------------

    def add_node(self, node: Any) -> bool:
        """Run this node's callbacks, and no other executor does; False where it was here already."""
        with self._lock:
            if node in self._nodes:
                return False
            ingress = node.handle.ingress
            if self._agenda.ingress() not in (None, ingress):
                raise UsageError("the nodes of one executor must share a context; use one executor a context")
            self._nodes = (*self._nodes, node)
            node.executor = self  # which removes it from the one it had
            self._agenda.add(node)
            if self._spins_on:
                heartbeat.follow(node.handle)
            if self._depth:
                self._served = ingress
                ingress.claim(self._agenda.queue, [node.handle])
        self.wake()
        return True

    def remove_node(self, node: Any) -> None:
        """Run its callbacks no more; what waits does so for the next executor. Nothing where it is not here."""
        with self._lock:
            if node not in self._nodes:
                return
            self._nodes = tuple(member for member in self._nodes if member is not node)
            handle = self._agenda.remove(node)
            if handle is not None and self._spins_on:
                heartbeat.leave(handle)
            if handle is not None and self._depth:
                handle.ingress.release(self._agenda.queue, [handle])
        self.wake()

    def get_nodes(self) -> list[Any]:
        """Those that were added."""
        return list(self._nodes)

    def can_execute(self, entity: Any) -> bool:
        """Whether the entity's callback group would let it run."""
        allowed: bool = entity.callback_group is not None and entity.callback_group.can_execute(entity)
        return allowed

    # -- tasks -----------------------------------------------------------------------------------------------------

    def create_task(
        self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any
    ) -> Task[Any]:
        """Run a function, coroutine function or coroutine while this spins; the result to come.

        What it raises comes out of `spin`, too.
        """
        task: Task[Any] = Task(callback, args, kwargs, executor=self)
        self._pending_tasks[task] = None
        self._call_task_in_next_spin(task)
        return task

    def create_future(self) -> Future[Any]:
        """A future whose done callbacks run here."""
        return Future(executor=self)

    def _call_task_in_next_spin(self, task: Task[Any]) -> None:
        self._agenda.add_task(task)
        self.wake()

    def _forget_task(self, task: Task[Any]) -> None:
        self._pending_tasks.pop(task, None)

    # -- the thread that spins -----------------------------------------------------------------------------------

    def _begin(self) -> None:
        """This thread spins: arrivals for the nodes come to it."""
        with self._lock:
            if self._depth and self._thread != threading.get_ident():
                raise RuntimeError("Executor is already spinning, on another thread")
            self._depth += 1
            if self._depth > 1:
                return
            self._thread = threading.get_ident()
            self._served = self._agenda.ingress()
            try:
                if self._served is not None:
                    self._served.claim(self._agenda.queue, self._agenda.handles, spins=True)
            except BaseException:
                self._depth = 0
                raise
        shorten_switch_interval(SWITCH_INTERVAL_S)

    def _end(self) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth:
                return
            self._thread = None
            if self._served is not None:
                self._served.release(self._agenda.queue, self._agenda.handles, spins=True)
                self._served = None
        if self._is_shutdown:
            self._clear()

    @contextmanager
    def _supervised(self) -> Iterator[None]:
        """Have a supervisor hear of each node while this spins on and on: who spins now and then may fall silent."""
        with self._lock:
            self._spins_on = True
            for handle in self._agenda.handles:
                heartbeat.follow(handle)
        try:
            yield
        finally:
            with self._lock:
                self._spins_on = False
                for handle in self._agenda.handles:
                    heartbeat.leave(handle)

    # -- the next callback -----------------------------------------------------------------------------------------

    def _next(
        self,
        timeout_sec: float | TimeoutObject | None,
        nodes: Collection[Any] | None = None,
        condition: Callable[[], bool] = never,
    ) -> Work | Task[Any]:
        """The next that may run; waits for it. TimeoutException, ShutdownException … where there is none."""
        timeout_s = None if timeout_sec is None else seconds(timeout_sec)
        end_s = None if timeout_s is None else time.monotonic() + timeout_s
        agenda, waited = self._agenda, False
        while True:
            if self._is_shutdown:
                raise ShutdownException
            if self._failures:
                raise self._failures.popleft()
            if condition is not never and condition():
                raise ConditionReachedException
            if agenda.entries and (entry := self._pop(nodes)) is not None:
                return entry
            self._asleep = True  # whatever becomes ready from now on ends the wait below
            if not self._context.ok():
                raise ExternalShutdownException
            if waited and nodes is None and (mail := self._next_mail()) is not None:
                self._asleep = False
                return mail
            self._stirred = False
            first = agenda.gather(self)
            if first is not None:
                if nodes is None or first.node in nodes:
                    self._asleep = False
                    return first
                agenda.put_back(first)
            if agenda.entries and (entry := self._pop(nodes)) is not None:
                self._asleep = False
                return entry
            waited = True
            if end_s is None and agenda.due_s is None:
                self._wait(None)
                continue
            now_s = time.monotonic()
            if end_s is not None and now_s >= end_s:
                raise TimeoutException
            self._wait(max(0.0, min(until_s - now_s for until_s in (end_s, agenda.due_s) if until_s is not None)))

    def _next_mail(self) -> Work | None:
        """A message that came alone, where nothing else can have become ready since the last look."""
        agenda = self._agenda
        if self._stirred or (agenda.due_s is not None and time.monotonic() >= agenda.due_s):
            return None
        return agenda.next_mail()

    def _pop(self, nodes: Collection[Any] | None = None) -> Work | Task[Any] | None:
        """The next that may run now; tasks that were cancelled are forgotten on the way."""
        while isinstance(entry := self._agenda.pop(nodes), Task) and (entry.done() or entry.cancelled()):
            entry.cancel()  # where it ran when somebody did
            self._forget_task(entry)
        return entry

    def _wait(self, timeout_s: float | None) -> None:
        ingress = self._agenda.ingress()
        if ingress is None:
            self._wakeup.wait(timeout_s)
        else:
            ingress.wait(self._agenda.queue, timeout_s)
        self._asleep = False

    def wake(self) -> None:
        """Have it look around; from any thread, and from handlers of signals."""
        self._stirred = True
        if self._asleep:
            self._wakeup.set()
            ingress = self._agenda.ingress()
            if ingress is not None:
                ingress.wake()

    # -- running it ------------------------------------------------------------------------------------------------

    def _run(self, entry: Work | Task[Any], limit: int) -> None:
        """On this thread; raises what the callback does."""
        if isinstance(entry, Task):
            self._go_on(entry)
        elif entry.enter():
            self._carry(entry, limit)
        else:
            self._refused(entry)

    @staticmethod
    def _refused(work: Work) -> None:
        """Its group does not let it run now."""
        work.no_more_ready()
        work.give_back()

    def _carry(self, work: Work, limit: int) -> None:
        """Run what has entered its group, and let a coroutine begin. Within `self._progress`."""
        coroutine = None
        try:
            coroutine = work.run(limit)
        finally:
            if coroutine is None:
                self._done(work)
        if coroutine is not None:
            task = HandlerTask(self._see_through(coroutine, work), work, self)
            self._pending_tasks[task] = None
            self._go_on(task)

    async def _see_through(self, coroutine: Coroutine[Any, Any, Any], work: Work) -> None:
        work.began()
        try:
            await coroutine
        finally:
            work.ended()
            self._done(work)

    async def _handle(self, work: Work) -> None:
        """What a handler of `wait_for_ready_callbacks` does."""
        if not self._agenda.holds(work):
            return
        if not work.enter():
            self._refused(work)
            return
        coroutine = None
        try:
            coroutine = work.run(1)
        finally:
            if coroutine is None:
                self._done(work)
        if coroutine is not None:
            await self._see_through(coroutine, work)

    def _done(self, work: Work) -> None:
        """It ran, or never will."""
        if work.taken is not None:
            work.taken()
        work.leave()
        work.give_back()
        if self._asleep:
            self.wake()

    def _go_on(self, task: Task[Any]) -> None:
        """Run a task up to where it awaits; raises what it raised at its end."""
        with self._progress:
            task()
        if task.done() or task.cancelled():
            self._forget_task(task)
            exception = task.exception()
            if exception is not None:
                raise exception

    # -- the end ---------------------------------------------------------------------------------------------------

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End every spin, and wait for callbacks that run on other threads: whether they ended in time.

        `timeout_sec` None or less than 0 waits for ever. What has not run stays with the nodes.
        """
        self._is_shutdown = True
        self.wake()
        if not self._progress.wait(timeout_sec):
            return False
        with self._lock:
            if not self._depth:
                self._clear()
        return True

    def _clear(self) -> None:
        """Let the nodes go, end what awaits."""
        self._nodes = ()
        self._callbacks = None
        self._agenda.clear()
        tasks, self._pending_tasks = self._pending_tasks, {}
        for task in tasks:
            task.cancel()

    def __enter__(self: E) -> E:
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()


def _abandon(stop: Callable[[], None], agenda: Agenda) -> None:
    stop()
    agenda.clear()


def seconds(timeout_sec: float | TimeoutObject | None) -> float | None:
    """A timeout as a number, None for ever."""
    given = timeout_sec.timeout if isinstance(timeout_sec, TimeoutObject) else timeout_sec
    return None if given is None or given < 0 else given
