"""`rclpy.timer.Rate`: a loop on a thread of its own that goes on at each call of a timer."""

from __future__ import annotations

import threading
from typing import Any

from metaros.concurrency.waiting import Wakeup
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.names.exceptions import ROSInterruptException

__all__ = ["Rate"]


class Rate:
    """`sleep()` returns at the timer's next call, at once where one came since the last sleep.

    The timer runs on the executor: something else than the thread that sleeps must spin the node.
    """

    def __init__(self, timer: Any, *, context: Context) -> None:
        self._timer = timer
        self._context = context
        self._lock = threading.Lock()
        self._sleepers: list[Wakeup] = []
        self._ticked = self._destroyed = self._shut = False
        timer.callback = self._tick
        context.on_shutdown(self._on_shutdown)

    def sleep(self) -> None:
        """Block until the next call of the timer, or until the rate is destroyed.

        Raises:
            ROSInterruptException: the context is shut down, before or meanwhile.
            RuntimeError: the rate was destroyed before.
        """
        self._check()
        woken = Wakeup()
        with self._lock:
            if self._ticked:
                self._ticked = False
                return
            self._sleepers.append(woken)
        stop = self._context.wake_with(woken.set)
        try:
            if self._context.ok() and not self._destroyed and not self._shut:
                woken.wait()
        finally:
            stop()
            with self._lock:
                if woken in self._sleepers:
                    self._sleepers.remove(woken)
        if self._shut or not self._context.ok():
            raise ROSInterruptException()

    def destroy(self) -> None:
        """End every sleep, and its timer."""
        self._destroyed = True
        self._wake()

    def _check(self) -> None:
        if self._shut or not self._context.ok():
            raise ROSInterruptException()
        if self._destroyed:
            raise RuntimeError("Rate cannot sleep because it has been destroyed")
        if self._timer.is_canceled():
            raise RuntimeError("Rate cannot sleep because its timer was canceled")

    def _tick(self) -> None:
        """The timer's callback."""
        with self._lock:
            self._ticked = not self._sleepers
        self._wake()

    def _on_shutdown(self) -> None:
        self._shut = True
        self._wake()

    def _wake(self) -> None:
        with self._lock:
            sleepers, self._sleepers = self._sleepers, []
        for woken in sleepers:
            woken.set()
