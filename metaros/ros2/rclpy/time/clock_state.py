"""What a clock shows: the machine's time, or for ROS time what somebody sets; and who is told of its jumps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from metaros.clock import SystemClock
from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.time.clock_type import ClockChange, ClockType

__all__ = ["ClockState", "Jump", "Watcher"]

_CHANGES = (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED)


@dataclass(frozen=True, slots=True)
class Jump:
    """How the clock jumps: whether its source changes, and by how much in one source."""

    change: ClockChange
    delta_ns: int = 0

    @property
    def of_source(self) -> bool:
        """Whether the time comes from somewhere else now."""
        return self.change in _CHANGES


@dataclass(eq=False, slots=True, kw_only=True)
class Watcher:
    """Who is told: `before` the new time is set and `after`, of jumps at least so large; 0 for those of no interest."""

    on_clock_change: bool
    min_forward_ns: int
    min_backward_ns: int
    before: Callable[[Jump], object] | None
    after: Callable[[Jump], object] | None

    def wants(self, jump: Jump) -> bool:
        """Whether the jump is large enough, or a change of the source."""
        if jump.of_source:
            return self.on_clock_change
        forward = 0 < self.min_forward_ns <= jump.delta_ns
        backward = 0 > self.min_backward_ns >= jump.delta_ns
        return forward or backward


class ClockState(Destroyable):
    """A clock without rclpy's classes of time. Watchers are called by whoever sets the time, one after another."""

    def __init__(self, clock_type: ClockType) -> None:
        self.clock_type = clock_type
        self.active = False  # whether ROS time is what was set, and not the system's
        self._set_ns = 0
        self._watchers: tuple[Watcher, ...] = ()
        self._lock = threading.RLock()  # a timer that is collected calls `forget` in the middle of anything
        self._system_ns = time.monotonic_ns if clock_type is ClockType.STEADY_TIME else SystemClock.wall_ns

    @property
    def runs(self) -> bool:
        """Whether time passes by itself, so that one may wait for it."""
        return not self.active

    def now_ns(self) -> int:
        """Nanoseconds since its start."""
        return self._set_ns if self.active else self._system_ns()

    def set_ros_time_ns(self, now_ns: int) -> None:
        """It is so late now, in ROS time; who watches is told where that is followed."""
        if not self.active:
            self._set_ns = now_ns
            return
        jump = Jump(ClockChange.ROS_TIME_NO_CHANGE, now_ns - self._set_ns)
        told = self._tell_before(jump)
        self._set_ns = now_ns
        self._tell_after(jump, told)

    def set_active(self, active: bool) -> None:
        """Show what is set, or the system's time again."""
        if active == self.active:
            return
        jump = Jump(ClockChange.ROS_TIME_ACTIVATED if active else ClockChange.ROS_TIME_DEACTIVATED)
        told = self._tell_before(jump)
        self.active = active
        self._tell_after(jump, told)

    def watch(self, watcher: Watcher) -> None:
        """Tell it of jumps."""
        with self._lock:
            self._watchers = (*self._watchers, watcher)

    def forget(self, watcher: Watcher) -> None:
        """The reverse of `watch`; safe to call twice."""
        with self._lock:
            self._watchers = tuple(other for other in self._watchers if other is not watcher)

    def _tell_before(self, jump: Jump) -> list[Watcher]:
        told = [watcher for watcher in self._watchers if watcher.wants(jump)]
        for watcher in told:
            if watcher.before is not None:
                watcher.before(jump)
        return told

    @staticmethod
    def _tell_after(jump: Jump, told: list[Watcher]) -> None:
        for watcher in told:
            if watcher.after is not None:
                watcher.after(jump)
