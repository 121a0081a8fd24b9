"""Points in time, against what rclpy's own tests ask of them."""

from __future__ import annotations

import operator
from typing import Any

import pytest

from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface


def test_they_are_made_within_63_bits_and_of_one_kind_of_clock() -> None:
    assert (Time().nanoseconds, Time().clock_type) == (0, ClockType.SYSTEM_TIME)
    assert Time(seconds=1, nanoseconds=5e8).nanoseconds == 1_500_000_000
    assert Time(nanoseconds=15e8).seconds_nanoseconds() == (1, 500_000_000)
    assert repr(Time(nanoseconds=7, clock_type=ClockType.ROS_TIME)) == "Time(nanoseconds=7, clock_type=ROS_TIME)"
    wrong: list[tuple[dict[str, Any], type[Exception]]] = [
        ({"nanoseconds": 2**63}, OverflowError),
        ({"seconds": -1}, ValueError),
        ({"nanoseconds": -1}, ValueError),
        ({"clock_type": "SYSTEM_TIME"}, TypeError),
    ]
    for arguments, error in wrong:
        with pytest.raises(error):
            Time(**arguments)


def test_arithmetic_keeps_the_clock() -> None:
    time = Time(nanoseconds=10, clock_type=ClockType.STEADY_TIME)
    span = Duration(nanoseconds=3)
    for moved, wanted in ((time + span, 13), (span + time, 13), (time - span, 7)):
        assert (moved.nanoseconds, moved.clock_type) == (wanted, ClockType.STEADY_TIME)
    assert Time(nanoseconds=1) - Time(nanoseconds=3) == Duration(nanoseconds=-2)
    with pytest.raises(OverflowError):
        span + Time(nanoseconds=2**63 - 1)
    with pytest.raises(ValueError, match="negative"):
        Time(nanoseconds=1) - span
    with pytest.raises(TypeError, match="different clock types"):
        time - Time(nanoseconds=1)
    with pytest.raises(TypeError):
        time + time  # type: ignore[operator]


def test_times_of_two_clocks_are_never_compared() -> None:
    system, steady = Time(nanoseconds=1), Time(nanoseconds=1, clock_type=ClockType.STEADY_TIME)
    compare = (operator.eq, operator.ne, operator.lt, operator.le, operator.gt, operator.ge)
    for one in compare:
        with pytest.raises(TypeError, match="different clock types"):
            one(system, steady)
    later = Time(nanoseconds=2)
    assert [one(system, later) for one in compare] == [False, True, True, True, False, False]
    assert Time(nanoseconds=5e9) == Time(seconds=5)
    assert system != Duration(nanoseconds=1)
    assert system != 1
    assert len({system, Time(nanoseconds=1), later}) == 2
    with pytest.raises(TypeError):
        _ = system < Duration(nanoseconds=1)


def test_messages_do_not_say_of_which_clock() -> None:
    time = Time(nanoseconds=1_553_575_413_247_045_598, clock_type=ClockType.ROS_TIME)
    message = time.to_msg()
    assert (message.sec, message.nanosec) == (1_553_575_413, 247_045_598)
    assert Time.from_msg(message) == time
    assert Time.from_msg(message, clock_type=ClockType.SYSTEM_TIME).clock_type is ClockType.SYSTEM_TIME
    with pytest.raises(TypeError, match=r"builtin_interfaces\.msg\.Time"):
        Time.from_msg(interface("builtin_interfaces/msg/Duration")())
