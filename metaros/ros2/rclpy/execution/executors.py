"""`rclpy.executors`: which thread runs callbacks."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.execution.executor import SLICED, Executor
from metaros.ros2.rclpy.execution.executor_core import never
from metaros.ros2.rclpy.execution.executor_errors import (
    ConditionReachedException,
    ExternalShutdownException,
    ShutdownException,
    TimeoutException,
    TimeoutObject,
)
from metaros.ros2.rclpy.execution.task import Future, Task
from metaros.ros2.rclpy.execution.work import Work

__all__ = [
    "ConditionReachedException",
    "Executor",
    "ExternalShutdownException",
    "Future",
    "MultiThreadedExecutor",
    "ShutdownException",
    "SingleThreadedExecutor",
    "Task",
    "TimeoutException",
    "TimeoutObject",
    "await_or_execute",
]

_ENDS: Final = (ShutdownException, TimeoutException, ConditionReachedException)


async def await_or_execute(callback: Callable[..., Any], *args: Any) -> Any:
    """Call it, and await it where it is a coroutine function."""
    result = callback(*args)
    return await result if inspect.iscoroutinefunction(callback) else result


class SingleThreadedExecutor(Executor):
    """Runs callbacks on the thread that spins. What one raises comes out of the spin."""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run the next callback that is ready, waiting up to `timeout_sec`; None or less than 0: for ever."""
        self._spin_once_impl(timeout_sec)

    def _spin_once_impl(
        self, timeout_sec: float | TimeoutObject | None = None, wait_condition: Callable[[], bool] = never
    ) -> None:
        self._begin()
        try:
            entry = self._next(timeout_sec, None, wait_condition)
            with self._progress:
                self._run(entry, 1)
        except _ENDS:
            return
        finally:
            self._end()


class MultiThreadedExecutor(Executor):
    """Runs callbacks on `num_threads` threads, as their groups allow: by default as many as there are CPUs for it.

    What one raises comes out of a later turn of the spin.
    """

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        if num_threads is None:
            affinity = getattr(os, "sched_getaffinity", None)
            num_threads = (len(affinity(0)) if affinity is not None else os.cpu_count()) or 2
        if num_threads == 1:
            warnings.warn(
                "MultiThreadedExecutor is used with a single thread.\nUse the SingleThreadedExecutor instead.",
                stacklevel=2,
            )
        self._executor = ThreadPoolExecutor(num_threads, thread_name_prefix="rclpy-executor")

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Hand the next callback that is ready to a thread, waiting up to `timeout_sec` for it, not for its end."""
        self._spin_once_impl(timeout_sec)

    def _spin_once_impl(
        self, timeout_sec: float | TimeoutObject | None = None, wait_condition: Callable[[], bool] = never
    ) -> None:
        self._begin()
        try:
            self._run(self._next(timeout_sec, None, wait_condition), 1)
        except (*_ENDS, ExternalShutdownException):
            return
        finally:
            self._end()

    def _spin_slices(self) -> None:
        try:
            super()._spin_slices()
        except ExternalShutdownException:  # as rclpy: its pool ends silently
            return

    def _run(self, entry: Work | Task[Any], limit: int) -> None:
        if isinstance(entry, Task):
            self._submit(lambda: self._go_on(entry), lambda: None)
        elif not entry.enter():
            self._refused(entry)
        else:
            self._agenda.hand(entry, self.wake)
            self._submit(lambda: self._carry(entry, limit), lambda: self._done(entry))

    def _submit(self, run: Callable[[], None], leave: Callable[[], None]) -> None:
        """Run it on a thread; where that comes to no run, `leave()`."""

        def labour() -> None:
            if self._is_shutdown:
                leave()
                return
            try:
                with self._progress:
                    run()
            except BaseException as error:  # KeyboardInterrupt belongs to the thread that spins, too
                self._failures.append(error)
                self.wake()

        try:
            self._executor.submit(labour)
        except RuntimeError:  # the pool is shut down
            leave()

    def shutdown(self, timeout_sec: float | None = None, *, wait_for_threads: bool = True) -> bool:
        """As `Executor.shutdown`; the threads end, and are waited for where `wait_for_threads`."""
        ended = super().shutdown(timeout_sec)
        on_a_worker = self._progress.mine()
        self._executor.shutdown(wait=wait_for_threads and ended and not on_a_worker)
        return ended


SLICED.update(
    {
        Executor.spin_once,
        SingleThreadedExecutor.spin_once,
        SingleThreadedExecutor._spin_once_impl,
        MultiThreadedExecutor.spin_once,
        MultiThreadedExecutor._spin_once_impl,
    }
)
