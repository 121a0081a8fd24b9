"""When a timer is due: a pure state, by the clock it is given, in the words of ROS's own timers."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable

from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.core.rcl_errors import TimerCancelledError
from metaros.ros2.rclpy.time.clock_state import ClockState, Jump, Watcher

__all__ = ["TimerHandle"]


class TimerHandle(Destroyable):
    """A period of a clock. Calls that come late are not made up for, and the grid of periods stays.

    `changed()` is called when it may be due earlier than an executor that waits expects. Where the clock's source
    changes only the rest of the period is left; where the clock goes back behind the last call, a full one.
    """

    def __init__(
        self, clock: ClockState, period_ns: int, changed: Callable[[], object], *, autostart: bool = True
    ) -> None:
        if period_ns < 0:
            raise ValueError(f"a timer's period must not be negative, but is {period_ns} ns")
        self.clock = clock
        self._period_ns = period_ns
        self._changed = changed
        self._cancelled = not autostart
        self._last_ns = clock.now_ns()
        self._next_ns = self._last_ns + period_ns
        self._elapsed_ns = 0  # of the period, when the clock's source changes
        self._lock = threading.Lock()
        self._watcher = _watch(self)

    # -- asked -----------------------------------------------------------------------------------------------------

    def is_timer_ready(self) -> bool:
        """Whether it is due."""
        return not self._cancelled and self.clock.now_ns() >= self._next_ns

    def is_timer_canceled(self) -> bool:
        """Whether it is not to be called, until it is reset."""
        return self._cancelled

    def time_until_next_call(self) -> int | None:
        """Nanoseconds, negative when it is late; None where it is cancelled."""
        return None if self._cancelled else self._next_ns - self.clock.now_ns()

    def time_since_last_call(self) -> int:
        """Nanoseconds since it was called, or made."""
        return self.clock.now_ns() - self._last_ns

    def get_timer_period(self) -> int:
        """Nanoseconds."""
        return self._period_ns

    def patience_s(self) -> float | None:
        """For how long it cannot become due by itself; None for ever."""
        if self._cancelled or not self.clock.runs:
            return None
        return max(0, self._next_ns - self.clock.now_ns()) / 1e9

    # -- told ------------------------------------------------------------------------------------------------------

    def change_timer_period(self, period_ns: int) -> None:
        """Another period, from the next call on; ValueError where it is negative."""
        if period_ns < 0:
            raise ValueError(f"a timer's period must not be negative, but is {period_ns} ns")
        self._period_ns = period_ns

    def cancel_timer(self) -> None:
        """Call it no more."""
        self._cancelled = True

    def reset_timer(self) -> None:
        """A full period from now; revives it."""
        with self._lock:
            self._next_ns = self.clock.now_ns() + self._period_ns
            self._cancelled = False
        self._changed()

    def call_timer(self) -> tuple[int, int]:
        """It is called now: when it was due, and the time. TimerCancelledError where it is cancelled."""
        with self._lock:
            if self._cancelled:
                raise TimerCancelledError("the timer was cancelled; reset() starts it anew")
            now_ns, due_ns, period_ns = self.clock.now_ns(), self._next_ns, self._period_ns
            self._last_ns = now_ns
            next_ns = due_ns + period_ns
            if next_ns < now_ns:  # whole periods were missed
                next_ns = now_ns if period_ns == 0 else next_ns + -(-(now_ns - next_ns) // period_ns) * period_ns
            self._next_ns = next_ns
        return due_ns, now_ns

    def close(self) -> None:
        """The end."""
        self._cancelled = True
        self.clock.forget(self._watcher)

    # -- jumps of its clock ----------------------------------------------------------------------------------------

    def before_jump(self, jump: Jump) -> None:
        """Remember how much of the period is over, where the time will come from elsewhere."""
        now_ns = self.clock.now_ns()
        if jump.of_source and now_ns:
            self._elapsed_ns = now_ns - self._last_ns

    def after_jump(self, jump: Jump) -> None:
        """Be due when that makes sense by the new time."""
        with self._lock:
            now_ns = self.clock.now_ns()
            if jump.of_source:
                elapsed_ns, self._elapsed_ns = self._elapsed_ns, 0
                if now_ns:  # a simulation that has not begun shows zero
                    self._last_ns = now_ns - elapsed_ns
                    self._next_ns = self._last_ns + self._period_ns
            elif now_ns < self._last_ns:
                self._last_ns = now_ns
                self._next_ns = now_ns + self._period_ns
            wake = jump.of_source or now_ns >= self._next_ns
        if wake and not self._cancelled:
            self._changed()


def _watch(timer: TimerHandle) -> Watcher:
    """Tell the timer of every jump, without keeping it alive."""
    reference = weakref.ref(timer, lambda _: clock.forget(watcher))
    clock = timer.clock

    def before(jump: Jump) -> None:
        if (living := reference()) is not None:
            living.before_jump(jump)

    def after(jump: Jump) -> None:
        if (living := reference()) is not None:
            living.after_jump(jump)

    watcher = Watcher(on_clock_change=True, min_forward_ns=1, min_backward_ns=-1, before=before, after=after)
    clock.watch(watcher)
    return watcher
