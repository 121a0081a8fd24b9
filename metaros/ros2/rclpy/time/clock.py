"""`rclpy.clock`: system, steady and ROS clocks, callbacks at their jumps, and sleeping by them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from metaros.concurrency.waiting import Wakeup
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.utilities import get_default_context
from metaros.ros2.rclpy.names.constants import S_TO_NS
from metaros.ros2.rclpy.names.exceptions import NotInitializedException
from metaros.ros2.rclpy.time.clock_state import ClockState, Jump, Watcher
from metaros.ros2.rclpy.time.clock_type import ClockChange, ClockType
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time

__all__ = ["Clock", "ClockChange", "ClockType", "JumpHandle", "JumpThreshold", "ROSClock", "TimeJump"]

_LOOK_S: Final = 1.0  # how often a sleep by the calendar looks whether somebody has set it


class JumpThreshold:
    """Of which jumps somebody is told: forward and backward from so much on, None for never; changes of the source.

    Raises:
        ValueError: `min_forward` is not positive, `min_backward` not negative, or nothing at all is wanted.
    """

    def __init__(
        self, *, min_forward: Duration | None, min_backward: Duration | None, on_clock_change: bool = True
    ) -> None:
        if min_forward is not None and min_forward.nanoseconds <= 0:
            raise ValueError("min_forward must be a positive non-zero duration")
        if min_backward is not None and min_backward.nanoseconds >= 0:
            raise ValueError("min_backward must be a negative non-zero duration")
        if min_forward is None and min_backward is None and not on_clock_change:
            raise ValueError("At least one jump threshold must be enabled")
        self.min_forward = min_forward
        self.min_backward = min_backward
        self.on_clock_change = on_clock_change


class TimeJump:
    """A jump that happened: `delta` is zero where the source changed."""

    def __init__(self, clock_change: ClockChange, delta: Duration) -> None:
        if not isinstance(clock_change, ClockChange):
            raise TypeError(f"clock_change must be an instance of rclpy.clock.ClockChange, not {clock_change!r}")
        self._clock_change = clock_change
        self._delta = delta

    @property
    def clock_change(self) -> ClockChange:
        """What happened to the source."""
        return self._clock_change

    @property
    def delta(self) -> Duration:
        """By how much the time changed."""
        return self._delta


class JumpHandle:
    """Callbacks at a clock's jumps, until `unregister`, or until the end of a `with` block."""

    def __init__(
        self,
        *,
        clock: Clock,
        threshold: JumpThreshold,
        pre_callback: Callable[[], object] | None,
        post_callback: Callable[[TimeJump], object] | None,
    ) -> None:
        if pre_callback is None and post_callback is None:
            raise ValueError("One of pre_callback or post_callback must be callable")
        for name, callback in (("pre_callback", pre_callback), ("post_callback", post_callback)):
            if callback is not None and not callable(callback):
                raise ValueError(f"{name} must be callable if given")
        self._clock: Clock | None = clock
        self._watcher = Watcher(
            on_clock_change=threshold.on_clock_change,
            min_forward_ns=0 if threshold.min_forward is None else threshold.min_forward.nanoseconds,
            min_backward_ns=0 if threshold.min_backward is None else threshold.min_backward.nanoseconds,
            before=None if pre_callback is None else lambda _: pre_callback(),
            after=None if post_callback is None else lambda jump: post_callback(_told(jump)),
        )
        clock.handle.watch(self._watcher)

    def unregister(self) -> None:
        """Call them no more; safe to call twice."""
        clock, self._clock = self._clock, None
        if clock is not None:
            clock.handle.forget(self._watcher)

    def __enter__(self) -> JumpHandle:
        return self

    def __exit__(self, *_: object) -> None:
        self.unregister()


def _told(jump: Jump) -> TimeJump:
    return TimeJump(jump.change, Duration(nanoseconds=jump.delta_ns))


class Clock:
    """`Clock(clock_type=…)` gives a clock of that kind: for ROS_TIME a ROSClock. TypeError where it is no ClockType."""

    _clock_type: ClockType
    _state: ClockState

    def __new__(cls, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> Clock:
        if not isinstance(clock_type, ClockType):
            raise TypeError(f"Clock type must be a ClockType enum, not {clock_type!r}")
        kind = ROSClock if clock_type is ClockType.ROS_TIME and not issubclass(cls, ROSClock) else cls
        self = super().__new__(kind)
        self._clock_type = clock_type
        self._state = ClockState(clock_type)
        return self

    @property
    def clock_type(self) -> ClockType:
        """What it shows."""
        return self._clock_type

    @property
    def handle(self) -> ClockState:
        """What timers and the executor ask."""
        return self._state

    def __repr__(self) -> str:
        return f"Clock(clock_type={self._clock_type.name})"

    def now(self) -> Time:
        """The time."""
        return Time(nanoseconds=self._state.now_ns(), clock_type=self._clock_type)

    def create_jump_callback(
        self,
        threshold: JumpThreshold,
        *,
        pre_callback: Callable[[], object] | None = None,
        post_callback: Callable[[TimeJump], object] | None = None,
    ) -> JumpHandle:
        """Call `pre_callback()` before and `post_callback(jump)` after jumps of that size. They must not block.

        ValueError where neither is given.
        """
        return JumpHandle(clock=self, threshold=threshold, pre_callback=pre_callback, post_callback=post_callback)

    def sleep_until(self, until: Time, context: Context | None = None) -> bool:
        """Block until then; False where that may never come, as the context ended or the time's source changed.

        Raises:
            NotInitializedException: the context, or the default one, is not initialised.
            ValueError: `until` is of another kind of clock.
        """
        context = get_default_context() if context is None else context
        if not context.ok():
            raise NotInitializedException()
        if until.clock_type != self._clock_type:
            raise ValueError(f"until's clock type does not match this clock's type, {self._clock_type.name}")
        state, woken, changes = self._state, Wakeup(), []

        def jumped(jump: Jump) -> None:
            if jump.of_source:
                changes.append(jump)
            woken.set()

        watcher = Watcher(on_clock_change=True, min_forward_ns=1, min_backward_ns=-1, before=None, after=jumped)
        state.watch(watcher)
        stop = context.wake_with(woken.set)
        try:
            while context.ok() and not changes:
                left_ns = until.nanoseconds - state.now_ns()
                if left_ns <= 0:
                    return True
                woken.wait(min(left_ns / S_TO_NS, _LOOK_S) if state.runs else None)
            return False
        finally:
            stop()
            state.forget(watcher)

    def sleep_for(self, rel_time: Duration, context: Context | None = None) -> bool:
        """Block for so long; the rest as `sleep_until`."""
        return self.sleep_until(self.now() + rel_time, context)


class ROSClock(Clock):
    """The system's time, or what a TimeSource sets while it follows a simulation."""

    def __new__(cls, **_: Any) -> ROSClock:
        self = super().__new__(cls, clock_type=ClockType.ROS_TIME)
        assert isinstance(self, ROSClock)
        return self

    @property
    def ros_time_is_active(self) -> bool:
        """Whether it shows what was set."""
        return self._state.active

    def _set_ros_time_is_active(self, enabled: bool) -> None:
        """For the TimeSource that manages it."""
        self._state.set_active(enabled)

    def set_ros_time_override(self, time: Time) -> None:
        """It is so late, from when ROS time is active; TypeError where that is no Time."""
        if not isinstance(time, Time):
            raise TypeError(f"Time must be specified as rclpy.time.Time. Received type: {type(time)}")
        self._state.set_ros_time_ns(time.nanoseconds)
