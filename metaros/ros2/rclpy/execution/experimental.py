"""`rclpy.experimental`: the executor that is told of events instead of asking; here every executor is."""

from __future__ import annotations

from typing import Any, Final

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.execution.executor_errors import (
    ConditionReachedException,
    ShutdownException,
    TimeoutException,
    TimeoutObject,
)
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.execution.task import Future

__all__ = ["EventsExecutor"]

_LAST: Final = 1000  # so many callbacks at most after the time is over


class EventsExecutor(SingleThreadedExecutor):
    """The single-threaded executor, which waits on one queue of arrivals already, but that takes things as they come.

    Tasks are run in the order in which they were created, and when a wait is over what is ready by then is still run.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._agenda.newest_first = False

    def spin_until_future_complete(self, future: Future[Any], timeout_sec: float | TimeoutObject | None = None) -> None:
        """As `Executor.spin_until_future_complete`; with 0 everything that is ready is run, and not only the next."""
        super().spin_until_future_complete(future, timeout_sec)
        self._begin()
        try:
            for _ in range(_LAST):
                self._run(self._next(0.0, None, lambda: future.done() or future.cancelled()), 1)
        except (TimeoutException, ShutdownException, ConditionReachedException):
            return
        finally:
            self._end()
