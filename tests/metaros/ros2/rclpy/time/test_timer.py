"""Timers by a ROS clock that the test sets, so that nothing waits; and what their callbacks take."""

from __future__ import annotations

import functools
import gc
import weakref
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, TimerCancelledError
from metaros.ros2.rclpy.time.clock import Clock, ROSClock
from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rclpy.time.timer import Timer, TimerInfo

_PERIOD_NS = 100


def _clock(now_ns: int = 1000) -> ROSClock:
    clock = ROSClock()
    clock.set_ros_time_override(Time(nanoseconds=now_ns))
    clock._set_ros_time_is_active(True)
    return clock


def _timer(clock: Clock, callback: Any = None, **options: Any) -> Timer:
    return Timer(callback, None, _PERIOD_NS, clock, context=Context(), **options)


def _set(clock: ROSClock, now_ns: int) -> None:
    clock.set_ros_time_override(Time(nanoseconds=now_ns))


def test_it_is_due_a_period_after_it_was_made() -> None:
    clock = _clock()
    timer = _timer(clock)
    assert (timer.timer_period_ns, timer.time_until_next_call(), timer.time_since_last_call()) == (100, 100, 0)
    _set(clock, 1099)
    assert not timer.is_ready()
    _set(clock, 1100)
    assert timer.is_ready()
    assert (timer.time_until_next_call(), timer.time_since_last_call()) == (0, 100)


def test_late_calls_are_not_made_up_for_and_the_grid_stays() -> None:
    clock = _clock()
    timer = _timer(clock)
    nexts = []
    for now_ns in (1100, 1250, 1777, 1800):
        _set(clock, now_ns)
        timer.take()
        nexts.append(now_ns + (timer.time_until_next_call() or 0))
    assert nexts == [1200, 1300, 1800, 1900]


def test_cancel_reset_and_another_period() -> None:
    clock = _clock()
    timer = _timer(clock, autostart=False)
    _set(clock, 2000)
    assert timer.is_canceled()
    assert not timer.is_ready()
    assert timer.time_until_next_call() is None
    with pytest.raises(TimerCancelledError):
        timer.take()
    timer.reset()
    assert (timer.is_canceled(), timer.time_until_next_call()) == (False, 100)
    timer.timer_period_ns = 500
    assert timer.time_until_next_call() == 100
    _set(clock, 2100)
    timer.take()
    assert timer.time_until_next_call() == 500
    timer.cancel()
    assert timer.is_canceled()
    with pytest.raises(ValueError, match="negative"):
        Timer(None, None, -1, clock, context=Context())


def test_a_period_of_zero_is_always_due() -> None:
    clock = _clock()
    timer = Timer(None, None, 0, clock, context=Context())
    for now_ns in (1000, 1500):
        _set(clock, now_ns)
        assert timer.is_ready()
        timer.take()
    assert timer.time_until_next_call() == 0


def test_a_clock_that_goes_back_gives_a_full_period() -> None:
    clock = _clock()
    timer = _timer(clock)
    _set(clock, 1050)
    timer.reset()
    _set(clock, 1040)
    assert timer.time_until_next_call() == 110  # back within what was since the last call, or the making: it stays
    _set(clock, 500)
    assert timer.time_until_next_call() == 100


def test_a_change_of_the_source_leaves_the_rest_of_the_period() -> None:
    clock = _clock()
    timer = Timer(None, None, 10**12, clock, context=Context())
    _set(clock, 1000 + 4 * 10**11)
    clock._set_ros_time_is_active(False)
    left_ns = timer.time_until_next_call()
    assert left_ns is not None
    assert 5 * 10**11 < left_ns <= 6 * 10**11


def test_what_makes_it_due_earlier_wakes_the_executors() -> None:
    clock, context, woken = _clock(), Context(), []
    timer = Timer(None, None, _PERIOD_NS, clock, context=context)
    context.wake_with(lambda: woken.append(clock.now().nanoseconds))
    for now_ns in (1050, 1100, 1200):
        _set(clock, now_ns)
    timer.reset()
    clock._set_ros_time_is_active(False)
    assert woken[:3] == [1100, 1200, 1200]
    assert len(woken) == 4
    timer.cancel()
    clock._set_ros_time_is_active(True)
    assert len(woken) == 4


def test_callbacks_that_take_a_timer_info_get_it() -> None:
    clock, told = _clock(), []

    def by_type(info: TimerInfo) -> None:  # an annotation that is text, in this file
        told.append(info)

    def by_other_name(*, when: TimerInfo) -> None:
        told.append(when)

    by_class = lambda info: told.append(info)  # noqa: E731
    by_class.__annotations__["info"] = TimerInfo
    timer = _timer(clock)
    for callback in (by_type, by_other_name, functools.partial(by_type), by_class):
        timer.callback = callback
        _set(clock, clock.now().nanoseconds + 130)
        call = timer.take()
        assert call is not None
        call()
    times = [(info.expected_call_time.nanoseconds, info.actual_call_time.nanoseconds) for info in told]
    assert times == [(1100, 1130), (1200, 1260), (1300, 1390), (1400, 1520)]
    assert told[0].expected_call_time.clock_type is told[0].actual_call_time.clock_type is ClockType.ROS_TIME
    timer.callback = print
    assert timer.take() is print
    timer.callback = None
    assert timer.take() is None
    empty = TimerInfo()
    assert empty.actual_call_time == empty.expected_call_time == Time()


def test_a_destroyed_timer_says_so_and_is_not_kept_by_its_clock() -> None:
    clock = _clock()
    with _timer(clock) as timer:
        assert not timer.is_canceled()
    for use in (timer.cancel, timer.reset, timer.is_ready, timer.take):
        with pytest.raises(InvalidHandle):
            use()
    timer.destroy()
    assert clock.handle._watchers == ()
    dropped = weakref.ref(_timer(clock))
    gc.collect()
    assert dropped() is None
    assert clock.handle._watchers == ()
