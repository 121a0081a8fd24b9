"""Clocks: what they show, who is told of their jumps, and sleeping by them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from metaros.clock import SystemClock
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.names.exceptions import NotInitializedException
from metaros.ros2.rclpy.time.clock import Clock, JumpHandle, JumpThreshold, ROSClock, TimeJump
from metaros.ros2.rclpy.time.clock_type import ClockChange, ClockType
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time
from tests.support.waiting import wait_until

_KINDS = (ClockType.SYSTEM_TIME, ClockType.STEADY_TIME, ClockType.ROS_TIME)


@pytest.fixture
def context() -> Context:
    """Initialised; nothing in it needs a session."""
    context = Context()
    context.init([])
    return context


def test_the_kind_decides_the_class() -> None:
    assert Clock().clock_type is ClockType.SYSTEM_TIME
    assert [Clock(clock_type=kind).clock_type for kind in _KINDS] == list(_KINDS)
    assert isinstance(Clock(clock_type=ClockType.ROS_TIME), ROSClock)
    assert not isinstance(Clock(), ROSClock)
    assert repr(ROSClock()) == "Clock(clock_type=ROS_TIME)"
    with pytest.raises(TypeError, match="ClockType"):
        Clock(clock_type="STEADY_TIME")  # type: ignore[arg-type]


def test_now() -> None:
    for kind in (ClockType.SYSTEM_TIME, ClockType.ROS_TIME):
        assert abs(Clock(clock_type=kind).now().nanoseconds - SystemClock.wall_ns()) < 5e9
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    times = [steady.now() for _ in range(5)]
    assert times == sorted(times, key=lambda time: time.nanoseconds)
    assert times[0] < times[-1]


def test_ros_time_shows_what_is_set_once_it_is_active() -> None:
    clock = ROSClock()
    clock.set_ros_time_override(Time(seconds=5))
    assert clock.now().seconds_nanoseconds()[0] > 1_000_000
    clock._set_ros_time_is_active(True)
    assert clock.ros_time_is_active
    assert clock.now() == Time(seconds=5, clock_type=ClockType.ROS_TIME)
    with pytest.raises(TypeError, match=r"rclpy\.time\.Time"):
        clock.set_ros_time_override(5)  # type: ignore[arg-type]


def test_thresholds_that_make_no_sense() -> None:
    second, back = Duration(seconds=1), Duration(seconds=-1)
    wrong: list[tuple[Any, Any, bool, str]] = [
        (Duration(), back, True, "min_forward"),
        (back, back, True, "min_forward"),
        (second, Duration(), True, "min_backward"),
        (second, second, True, "min_backward"),
        (None, None, False, "must be enabled"),
    ]
    for forward, backward, change, told in wrong:
        with pytest.raises(ValueError, match=told):
            JumpThreshold(min_forward=forward, min_backward=backward, on_clock_change=change)
    clock, threshold = ROSClock(), JumpThreshold(min_forward=second, min_backward=None)
    with pytest.raises(ValueError, match="must be callable"):
        clock.create_jump_callback(threshold)
    with pytest.raises(ValueError, match="post_callback"):
        clock.create_jump_callback(threshold, post_callback=5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="ClockChange"):
        TimeJump(1, second)  # type: ignore[arg-type]


def _watched(clock: ROSClock, forward_s: float | None, backward_s: float | None, *, change: bool) -> list[Any]:
    """What is told of jumps: the clock's time before, then the jump."""
    told: list[Any] = []
    clock.create_jump_callback(
        JumpThreshold(
            min_forward=None if forward_s is None else Duration(seconds=forward_s),
            min_backward=None if backward_s is None else Duration(seconds=backward_s),
            on_clock_change=change,
        ),
        pre_callback=lambda: told.append(clock.now().nanoseconds),
        post_callback=lambda jump: told.append((jump.clock_change, jump.delta.nanoseconds)),
    )
    return told


def test_jumps_are_told_from_their_threshold_on_before_and_after() -> None:
    clock = ROSClock()
    coarse = _watched(clock, 1, -0.5, change=False)
    fine = _watched(clock, 0.5, -1, change=False)
    clock.set_ros_time_override(Time(seconds=1))
    clock._set_ros_time_is_active(True)
    assert coarse == fine == []
    clock.set_ros_time_override(Time(seconds=1.75))
    assert coarse == []
    assert fine == [1_000_000_000, (ClockChange.ROS_TIME_NO_CHANGE, 750_000_000)]
    clock.set_ros_time_override(Time(seconds=1))
    assert coarse == [1_750_000_000, (ClockChange.ROS_TIME_NO_CHANGE, -750_000_000)]
    assert len(fine) == 2


def test_a_change_of_the_source_is_told_once_to_those_who_ask() -> None:
    clock = ROSClock()
    deaf = _watched(clock, 1, -1, change=False)
    only, both = _watched(clock, None, None, change=True), _watched(clock, 1, -1, change=True)
    for active, change in ((True, ClockChange.ROS_TIME_ACTIVATED), (False, ClockChange.ROS_TIME_DEACTIVATED)):
        for _ in range(2):
            clock._set_ros_time_is_active(active)
        assert deaf == []
        assert [told[1] for told in (only, both)] == [(change, 0)] * 2
        assert len(only) == len(both) == 2
        only.clear()
        both.clear()


def test_a_handle_ends_what_is_told() -> None:
    clock, told = ROSClock(), list[TimeJump]()
    threshold = JumpThreshold(min_forward=None, min_backward=None, on_clock_change=True)
    with clock.create_jump_callback(threshold, post_callback=told.append) as handle:
        assert isinstance(handle, JumpHandle)
        clock._set_ros_time_is_active(True)
    clock._set_ros_time_is_active(False)
    handle.unregister()
    assert len(told) == 1


def test_sleeping(context: Context) -> None:
    for kind in _KINDS:
        clock = Clock(clock_type=kind)
        start = clock.now()
        assert clock.sleep_for(Duration(seconds=0.01), context)
        assert clock.now() - start >= Duration(seconds=0.01)
        assert clock.sleep_until(start, context)
    with pytest.raises(ValueError, match="clock type does not match"):
        Clock().sleep_until(Time(clock_type=ClockType.STEADY_TIME), context)
    with pytest.raises(NotInitializedException):
        Clock().sleep_for(Duration(seconds=1), Context())


def _ended_by(clock: Clock, until: Time, context: Context, end: Callable[[], object]) -> bool:
    """What a sleep on another thread returns once `end()` has ended it."""
    outcome: list[bool] = []
    thread = threading.Thread(target=lambda: outcome.append(clock.sleep_until(until, context)), daemon=True)
    thread.start()
    wait_until(lambda: bool(context._wakers))  # it sleeps, or is about to: both end alike
    end()
    thread.join(5)
    return outcome[0]


def test_what_ends_a_sleep_early(context: Context) -> None:
    clock = ROSClock()
    far = clock.now() + Duration(seconds=1000)
    for active in (True, False):
        assert not _ended_by(clock, far, context, lambda active=active: clock._set_ros_time_is_active(active))  # type: ignore[misc]
    clock._set_ros_time_is_active(True)
    assert _ended_by(clock, far, context, lambda: clock.set_ros_time_override(far))
    for kind in _KINDS:
        other = Context()
        other.init([])
        own = Clock(clock_type=kind)
        assert not _ended_by(own, own.now() + Duration(seconds=1000), other, other.shutdown)
