"""The root of executors: how they spin, and what custom ones take their work from."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from typing import Any, Final

from metaros.executor.interrupts import interrupts
from metaros.ros2.rclpy.execution.executor_core import ExecutorCore, never, seconds
from metaros.ros2.rclpy.execution.executor_errors import ConditionReachedException, ShutdownException, TimeoutObject
from metaros.ros2.rclpy.execution.handler_task import HandlerTask
from metaros.ros2.rclpy.execution.task import Future, Task
from metaros.ros2.rclpy.execution.work import MailWork, Work

__all__ = ["SLICED", "Executor"]

_SLICE: Final = 64  # items of one mailbox before timers and the others have their turn
_QUICK: Final = 16  # messages that come alone, one after another, before a look at everything
SLICED: Final[set[Any]] = set()  # methods of executors that slices can stand in for


class Executor(ExecutorCore):
    """Runs callbacks of the nodes that are added to it. One of your own defines `spin_once`.

    There it takes the next callback from `wait_for_ready_callbacks` and calls it on a thread of its choice. `context`
    is the default one where none is given; its shutdown ends every wait.
    """

    # -- spinning --------------------------------------------------------------------------------------------------

    def spin(self) -> None:
        """Run callbacks until this or the context is shut down, or one raises.

        Raises:
            ExternalShutdownException: the context was shut down while nothing ran.
            KeyboardInterrupt: at Ctrl-C, whatever it interrupts.
            RuntimeError: another thread spins it.
        """
        turn = self._turn()
        self._begin()
        try:
            with interrupts(self.wake) as interrupted, self._supervised():
                while self._context.ok() and not self._is_shutdown:
                    turn()
                    interrupted.check()
        finally:
            self._end()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run the next callback that is ready, waiting up to `timeout_sec`; None or less than 0: for ever."""
        raise NotImplementedError("an executor of your own defines spin_once")

    def spin_until_future_complete(self, future: Future[Any], timeout_sec: float | TimeoutObject | None = None) -> None:
        """Run callbacks until the future is done or cancelled, or the time is over; None or less than 0: for ever."""
        timeout = TimeoutObject(-1.0 if (given := seconds(timeout_sec)) is None else given)
        end_s = time.monotonic() + timeout.timeout
        with interrupts(self.wake) as interrupted:
            while self._context.ok() and not self._is_shutdown and not future.done() and not future.cancelled():
                self.spin_once_until_future_complete(future, timeout)
                interrupted.check()
                if given is not None:
                    timeout.timeout = end_s - time.monotonic()
                    if timeout.timeout <= 0:
                        return

    def spin_once_until_future_complete(
        self, future: Future[Any], timeout_sec: float | TimeoutObject | None = None
    ) -> None:
        """Run the next callback, unless the future is done before there is one."""
        future._add_waiter(self._waiter)
        if type(self).spin_once in SLICED:
            self._spin_once_impl(timeout_sec, lambda: future.done() or future.cancelled())
        else:
            self.spin_once(seconds(timeout_sec))

    def _spin_once_impl(
        self, timeout_sec: float | TimeoutObject | None = None, wait_condition: Callable[[], bool] = never
    ) -> None:
        raise NotImplementedError("an executor of your own defines spin_once")

    def _turn(self) -> Callable[[], object]:
        """What `spin` does again and again: what a subclass defines, else slices of everything ready."""
        kind = type(self)
        if kind.spin_once not in SLICED:
            return self.spin_once
        return self._spin_slices if kind._spin_once_impl in SLICED else self._spin_once_impl

    def _spin_slices(self) -> None:
        """All that is ready, each in its turn; else wait for something."""
        agenda = self._agenda
        try:
            entry: Work | Task[Any] | None = self._next(None)
        except (ShutdownException, ConditionReachedException):
            return
        progress, quick = self._progress, _QUICK
        outer, progress.spinner = progress.spinner, self._thread
        try:
            while entry is not None:
                self._run(entry, _SLICE)
                if self._is_shutdown or self._failures or not self._context.ok():
                    return
                if agenda.due_s is not None and time.monotonic() >= agenda.due_s:
                    agenda.gather_timers()
                if agenda.entries:
                    entry = self._pop()
                elif quick:
                    quick -= 1
                    entry = self._next_mail()
                else:
                    return
        finally:
            progress.spinner = outer
            if progress.waiting:
                progress.tell()

    def wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> tuple[Task[Any], Any, Any]:
        """The next callback that is ready, as a task to call, with its entity and node; arguments as the generator's.

        Entity and node are None for tasks of `create_task`.
        """
        while True:
            if self._callbacks is None or self._arguments != (args, kwargs):
                self._arguments = (args, kwargs)
                self._callbacks = self._wait_for_ready_callbacks(*args, **kwargs)
            try:
                return next(self._callbacks)
            except StopIteration:
                self._callbacks = None
            except BaseException:
                self._callbacks = None
                raise

    def _wait_for_ready_callbacks(
        self,
        timeout_sec: float | TimeoutObject | None = None,
        nodes: Collection[Any] | None = None,
        condition: Callable[[], bool] = never,
    ) -> Iterator[tuple[Task[Any], Any, Any]]:
        """One callback after another: of these nodes, or of all; each wait is at most `timeout_sec`.

        Raises:
            TimeoutException: nothing was ready in time.
            ShutdownException, ExternalShutdownException: this, or the context, was shut down.
            ConditionReachedException: `condition()` is true.
        """
        while True:
            self._begin()
            try:
                entry = self._next(timeout_sec, nodes, condition)
            finally:
                self._end()
            if isinstance(entry, HandlerTask):
                yield entry, _entity(entry.work), entry.node
            elif isinstance(entry, Task):
                yield entry, None, None
            else:
                self._agenda.hand(entry, self.wake)
                handler = HandlerTask(self._handle, entry, self, args=(entry,))
                self._pending_tasks[handler] = None
                yield handler, _entity(entry), entry.node


def _entity(work: Work) -> Any:
    return work.owner() if isinstance(work, MailWork) else work.entity
