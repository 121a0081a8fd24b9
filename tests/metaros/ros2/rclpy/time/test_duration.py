"""Spans of time, against what rclpy's own tests ask of them."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.time.duration import Duration, Infinite
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface

_END = 2**63


def test_they_are_made_of_seconds_and_nanoseconds_within_64_bits() -> None:
    made = {
        "nothing": (Duration(), 0),
        "both": (Duration(seconds=1, nanoseconds=5e8), 1_500_000_000),
        "parts of a nanosecond": (Duration(nanoseconds=1.9), 1),
        "negative": (Duration(seconds=-1), -1_000_000_000),
        "the largest": (Duration(nanoseconds=_END - 1), _END - 1),
        "the smallest": (Duration(nanoseconds=-_END), -_END),
        "the smallest in seconds": (Duration(seconds=-_END / 1e9), -_END),
    }
    assert {name: duration.nanoseconds for name, (duration, _) in made.items()} == {
        name: wanted for name, (_, wanted) in made.items()
    }
    for arguments in ({"nanoseconds": _END}, {"nanoseconds": -_END - 1}, {"seconds": -_END / 1e9 - 1}):
        with pytest.raises(OverflowError, match="64 bits"):
            Duration(**arguments)


def test_arithmetic() -> None:
    two, three = Duration(seconds=2), Duration(seconds=3)
    assert (two + three, three - two, two - three) == (Duration(seconds=5), Duration(seconds=1), Duration(seconds=-1))
    assert (two * 2, two * 0.25, 3 * two, -two) == (
        Duration(seconds=4),
        Duration(seconds=0.5),
        Duration(seconds=6),
        Duration(seconds=-2),
    )
    assert two * float("inf") == Infinite
    with pytest.raises(ValueError, match="nan"):
        two * float("nan")
    for other in (1, "1"):
        with pytest.raises(TypeError):
            two + other
    with pytest.raises(TypeError):
        two - Time(nanoseconds=1)


def test_they_compare_with_their_like_alone() -> None:
    one, two = Duration(nanoseconds=1), Duration(nanoseconds=2)
    assert one < two
    assert two >= one
    assert one != two
    assert Duration(nanoseconds=5e9) == Duration(seconds=5)
    assert one != Time(nanoseconds=1)
    assert one != 1
    assert len({one, Duration(nanoseconds=1), two}) == 2
    with pytest.raises(TypeError):
        _ = one < Time(nanoseconds=1)


def test_they_are_shown_and_become_messages() -> None:
    assert repr(Duration(nanoseconds=7)) == "Duration(nanoseconds=7)"
    assert (str(Duration(nanoseconds=7)), str(Infinite)) == ("7 nanoseconds", "Infinite")
    message = Duration(nanoseconds=-1).to_msg()
    assert (message.sec, message.nanosec) == (-1, 999_999_999)
    assert Duration.from_msg(message) == Duration(nanoseconds=-1)
    with pytest.raises(TypeError, match=r"builtin_interfaces\.msg\.Duration"):
        Duration.from_msg(interface("builtin_interfaces/msg/Time")())
