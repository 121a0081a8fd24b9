"""What executors give out of themselves: tasks that run something ready, and what a future wakes."""

from __future__ import annotations

import weakref
from typing import Any

from metaros.ros2.rclpy.execution.task import Task
from metaros.ros2.rclpy.execution.work import Work

__all__ = ["HandlerTask", "Waiter"]


class Waiter:
    """What a future wakes when it is over: an executor, without keeping it alive."""

    __slots__ = ("_executor",)

    def __init__(self, executor: Any) -> None:
        self._executor = weakref.ref(executor)

    def _wake_up(self) -> None:
        if (executor := self._executor()) is not None:
            executor.wake()


class HandlerTask(Task[None]):
    """One run of something ready, to its end if it awaits: what `wait_for_ready_callbacks` gives out."""

    def __init__(self, handler: Any, work: Work, executor: Any, *, args: tuple[Any, ...] = ()) -> None:
        super().__init__(handler, args, executor=executor)
        self.node = work.node
        self.work = work
        self._progress = executor._progress

    def __call__(self) -> None:
        """Run it, or go on; shutting down waits meanwhile."""
        with self._progress:
            super().__call__()
        if self._over() and (executor := self._living_executor()) is not None:
            executor._forget_task(self)  # type: ignore[attr-defined]
