"""`rclpy.timer`: callbacks every so often, by any clock; an executor that spins the node calls them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from metaros.executor import CallbackGroup
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.utilities import get_default_context
from metaros.ros2.rclpy.time.clock import Clock
from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.rate import Rate
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rclpy.time.timer_handle import TimerHandle

__all__ = ["Rate", "Timer", "TimerInfo"]


class TimerInfo:
    """When a timer's call was due and when it came, by the timer's clock: for callbacks that take a TimerInfo."""

    def __init__(
        self,
        *,
        expected_call_time: int = 0,
        actual_call_time: int = 0,
        clock_type: ClockType = ClockType.SYSTEM_TIME,
    ) -> None:
        self._expected_call_time = Time(nanoseconds=expected_call_time, clock_type=clock_type)
        self._actual_call_time = Time(nanoseconds=actual_call_time, clock_type=clock_type)

    @property
    def expected_call_time(self) -> Time:
        """When it was due."""
        return self._expected_call_time

    @property
    def actual_call_time(self) -> Time:
        """When it came."""
        return self._actual_call_time


class Timer:
    """Calls `callback()`, or `callback(info=TimerInfo)` by any name, every `timer_period_ns` of its clock.

    Without `autostart` it is as if cancelled until `reset`. Late calls are not made up for.
    """

    def __init__(
        self,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None,
        timer_period_ns: int,
        clock: Clock,
        *,
        context: Context | None = None,
        autostart: bool = True,
    ) -> None:
        self._context = get_default_context() if context is None else context
        self._clock = clock
        self._handle = TimerHandle(clock.handle, int(timer_period_ns), self._context.wake, autostart=autostart)
        self._asked: Callable[..., Any] | None = None  # the callback whose signature was looked at
        self._info_name: str | None = None  # its argument for a TimerInfo
        self.callback = callback
        self.callback_group = callback_group

    @property
    def handle(self) -> TimerHandle:
        """What says when it is due."""
        return self._handle

    @property
    def clock(self) -> Clock:
        """By which it runs."""
        return self._clock

    @property
    def timer_period_ns(self) -> int:
        """The period; a new one counts from the next call on."""
        return self._handle.get_timer_period()

    @timer_period_ns.setter
    def timer_period_ns(self, value: float) -> None:
        with self._handle:
            self._handle.change_timer_period(int(value))

    def is_ready(self) -> bool:
        """Whether it is due."""
        with self._handle:
            return self._handle.is_timer_ready()

    def is_canceled(self) -> bool:
        """Whether it will not be called, until it is reset."""
        with self._handle:
            return self._handle.is_timer_canceled()

    def cancel(self) -> None:
        """Call it no more."""
        with self._handle:
            self._handle.cancel_timer()

    def reset(self) -> None:
        """Begin a full period now; revives it."""
        with self._handle:
            self._handle.reset_timer()

    def time_since_last_call(self) -> int:
        """Nanoseconds."""
        with self._handle:
            return self._handle.time_since_last_call()

    def time_until_next_call(self) -> int | None:
        """Nanoseconds, negative when it is late; None when it is cancelled."""
        with self._handle:
            return self._handle.time_until_next_call()

    def destroy(self) -> None:
        """End it. Programs say `node.destroy_timer(timer)`, which takes it from the node as well."""
        self._handle.destroy_when_not_in_use()

    def take(self) -> Callable[[], Any] | None:
        """For executors: it is called now, by what is returned; None where there is nothing to call.

        TimerCancelledError where it was cancelled, InvalidHandle where it was destroyed.
        """
        with self._handle:
            due_ns, now_ns = self._handle.call_timer()
        callback = self.callback
        if callback is None:
            return None
        if callback is not self._asked:
            self._info_name = _info_argument(callback)
            self._asked = callback
        if self._info_name is None:
            return callback
        name, kind = self._info_name, self._clock.clock_type
        info = TimerInfo(expected_call_time=due_ns, actual_call_time=now_ns, clock_type=kind)
        return lambda: callback(**{name: info})

    def __enter__(self) -> Timer:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


def _info_argument(callback: Callable[..., Any]) -> str | None:
    """The name of the argument that is annotated as a TimerInfo, also where annotations are text."""
    try:
        parameters = inspect.signature(callback).parameters.values()
    except (TypeError, ValueError):  # a builtin that does not tell
        return None
    for parameter in parameters:
        annotation = parameter.annotation
        if annotation is TimerInfo or (isinstance(annotation, str) and annotation.split(".")[-1] == TimerInfo.__name__):
            return parameter.name
    return None
