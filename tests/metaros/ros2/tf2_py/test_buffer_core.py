"""The tree of frames: what is kept, what is refused, and what it says of itself."""

from __future__ import annotations

import logging
import math
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from metaros.limits import LIMITS
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TransformException,
)
from metaros.ros2.tf2_py.conversions import transform_stamped

SECOND = 1_000_000_000
HALF = math.sqrt(0.5)
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def at(seconds: float) -> Any:
    return SimpleNamespace(nanoseconds=round(seconds * SECOND))


def edge(parent: str, child: str, seconds: float = 0.0, x: float = 1.0, turned: Any = STRAIGHT) -> Any:
    return transform_stamped(parent, child, round(seconds * SECOND), ((x, 0.0, 0.0), turned))


def x_of(buffer: BufferCore, target: str, source: str, seconds: float) -> float:
    found: float = buffer.lookup_transform_core(target, source, at(seconds)).transform.translation.x
    return found


def test_times_are_messages_or_objects_with_nanoseconds() -> None:
    buffer = BufferCore(interface("builtin_interfaces/msg/Duration")(sec=5))
    buffer.set_transform(edge("a", "b", 1.0), "tests")
    moment = interface("builtin_interfaces/msg/Time")(sec=1)
    found = buffer.lookup_transform_core(target_frame="a", source_frame="b", time=moment)
    assert found == edge("a", "b", 1.0)
    assert type(found) is interface("geometry_msgs/msg/TransformStamped")
    with pytest.raises(TypeError, match="time must have sec and nanosec, or nanoseconds; float has neither"):
        buffer.lookup_transform_core("a", "b", 1.0)
    told = SimpleNamespace(
        header=interface("std_msgs/msg/Header")(frame_id="a"), child_frame_id="b", transform=SimpleNamespace()
    )
    with pytest.raises(TypeError, match="translation"):
        buffer.set_transform(told, "tests")


def test_a_frame_turned_by_a_quarter() -> None:
    buffer = BufferCore()
    buffer.set_transform_static(edge("map", "base", turned=(0.0, 0.0, HALF, HALF)), "tests")
    buffer.set_transform_static(edge("base", "laser", x=2.0), "tests")
    forth = buffer.lookup_transform_core("map", "laser", at(7)).transform
    assert (forth.translation.x, forth.translation.y) == pytest.approx((1.0, 2.0))
    back = buffer.lookup_transform_core("laser", "map", at(7)).transform
    assert (back.translation.x, back.translation.y) == pytest.approx((-2.0, 1.0))
    assert back.rotation.z == pytest.approx(-HALF)


def test_samples_are_kept_for_the_cache_time_and_pruned_with_the_next() -> None:
    buffer = BufferCore(at(2))
    for seconds in (1, 2, 3, 4):
        buffer.set_transform(edge("a", "b", seconds, x=float(seconds)), "tests")
    assert x_of(buffer, "a", "b", 1.5) == 1.5, "4 s made it too old, and what comes next takes it away"
    buffer.set_transform(edge("a", "b", 4.5), "tests")
    with pytest.raises(ExtrapolationException, match=r"into the past.* 1\.500000 .* 2\.000000.*\[b\] to frame \[a\]"):
        buffer.lookup_transform_core("a", "b", at(1.5))
    assert x_of(buffer, "a", "b", 2.5) == 2.5


def test_old_data_is_refused_and_said_ever_more_rarely(caplog: pytest.LogCaptureFixture) -> None:
    buffer = BufferCore(at(2))
    buffer.set_transform(edge("a", "b", 10), "tests")
    for _ in range(9):
        buffer.set_transform(edge("a", "b", 7, x=5.0), "somebody")
    assert x_of(buffer, "a", "b", 0) == 1.0
    assert not buffer.can_transform_core("a", "b", at(7))[0]
    assert [record.args[-1] for record in caplog.records if record.args] == [  # type: ignore[index]
        "",
        " (2 times by now)",
        " (4 times by now)",
        " (8 times by now)",
    ]
    assert "TF_OLD_DATA" in caplog.text
    assert "somebody" in caplog.text


def test_nonsense_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    cases = {
        "TF_SELF_TRANSFORM": edge("a", "/a"),
        "TF_NO_CHILD_FRAME_ID": edge("a", "/"),
        "TF_NO_FRAME_ID": edge("", "a"),
        "TF_NAN_INPUT": edge("a", "b", x=math.nan),
        "TF_DENORMALIZED_QUATERNION": edge("a", "b", turned=(0.0, 0.0, 0.0, 1.1)),
        "TF_LONG_FRAME_ID": edge("a", "b" * 1_000_000),
    }
    buffer = BufferCore()
    for message in cases.values():
        buffer.set_transform(message, "tests")
    assert [record.args[0] for record in caplog.records if record.args] == list(cases)  # type: ignore[index]
    assert max(len(record.getMessage()) for record in caplog.records) < 1000
    assert buffer._getFrameStrings() == []
    assert buffer.all_frames_as_yaml() == "[]"


def test_slashes_in_front_are_taken_off_what_is_told_and_refused_where_it_is_asked() -> None:
    buffer = BufferCore()
    buffer.set_transform(edge("/a", "/b", 1), "tests")
    assert x_of(buffer, "a", "b", 1) == 1.0
    assert buffer._frameExists("a")
    assert not buffer._frameExists("/a")
    for name in ("", "/b"):
        with pytest.raises(InvalidArgumentException, match="source_frame"):
            buffer.lookup_transform_core("a", name, at(1))
        able, why = buffer.can_transform_core("a", name, at(1))
        assert (able, "source_frame" in why) == (False, True)
    with pytest.raises(LookupException, match='"c" of lookup_transform argument fixed_frame does not exist'):
        buffer.lookup_transform_full_core("a", at(1), "b", at(1), "c")


def test_one_frame_needs_no_tree() -> None:
    buffer = BufferCore()
    found = buffer.lookup_transform_core("nobody", "nobody", at(3))
    assert found.header.stamp.sec == 3
    assert found.transform.rotation.w == 1.0
    assert buffer.can_transform_core("nobody", "nobody", at(3)) == (True, "")
    buffer.set_transform(edge("a", "b", 4), "tests")
    assert buffer.lookup_transform_core("b", "b", at(0)).header.stamp.sec == 4
    assert buffer.lookup_transform_core("a", "a", at(0)).header.stamp.sec == 0


def test_what_was_cleared_is_gone_but_for_what_is_static() -> None:
    buffer = BufferCore()
    buffer.set_transform(edge("a", "b", 4), "tests")
    buffer.set_transform_static(edge("b", "c", 4), "tests")
    buffer.clear()
    with pytest.raises(ConnectivityException, match="Could not find a connection between 'a' and 'c'"):
        buffer.lookup_transform_core("a", "c", at(0))
    with pytest.raises(ExtrapolationException, match=r"there is no data of frame \[b\]"):
        buffer.lookup_transform_core("a", "c", at(4))
    assert x_of(buffer, "b", "c", 9) == 1.0
    assert "Frame b exists with parent NO_PARENT." in buffer.all_frames_as_string()


def test_a_frame_that_becomes_static_and_moves_again() -> None:
    buffer = BufferCore()
    buffer.set_transform(edge("a", "b", 4), "tests")
    buffer.set_transform_static(edge("a", "b", 4, x=2.0), "tests")
    assert x_of(buffer, "a", "b", 99) == 2.0
    buffer.set_transform(edge("a", "b", 5, x=3.0), "tests")
    assert not buffer.can_transform_core("a", "b", at(99))[0]
    assert x_of(buffer, "a", "b", 5) == 3.0


def test_between_two_parents_the_earlier_one_holds() -> None:
    buffer = BufferCore()
    for root in ("left", "right"):
        buffer.set_transform_static(edge("map", root, x=10.0 if root == "left" else 20.0), "tests")
    buffer.set_transform(edge("left", "cup", 1), "tests")
    buffer.set_transform(edge("right", "cup", 2), "tests")
    assert [x_of(buffer, "map", "cup", seconds) for seconds in (1, 1.9, 2, 0)] == [11.0, 11.0, 21.0, 21.0]


def test_a_circle_is_an_error_that_names_who_is_in_it() -> None:
    buffer = BufferCore()
    buffer.set_transform_static(edge("a", "b"), "tests")
    buffer.set_transform_static(edge("b", "a"), "tests")
    buffer.set_transform_static(edge("x", "y"), "tests")
    for time in (at(0), at(5)):
        with pytest.raises(LookupException, match=r"contains a loop.*a -> b …"):
            buffer.lookup_transform_core("x", "a", time)


def test_time_travel_through_a_fixed_frame() -> None:
    buffer = BufferCore()
    for seconds in (1, 2, 3):
        buffer.set_transform(edge("map", "base", seconds, x=float(seconds)), "tests")
    found = buffer.lookup_transform_full_core(
        target_frame="base", target_time=at(3), source_frame="base", source_time=at(1), fixed_frame="map"
    )
    assert found.transform.translation.x == -2.0
    assert found.header.stamp.sec == 3
    assert buffer.can_transform_full_core("base", at(3), "base", at(1), "map") == (True, "")
    able, why = buffer.can_transform_full_core("base", at(4), "base", at(1), "map")
    assert (able, "extrapolation into the future" in why) == (False, True)
    with pytest.raises(ExtrapolationException, match="into the future"):
        buffer.lookup_transform_full_core("base", at(4), "base", at(1), "map")


def test_bounds(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    from dataclasses import replace

    monkeypatch.setattr("metaros.ros2.tf2_py.buffer_core.LIMITS", replace(LIMITS, tf_frames=3, tf_samples=4))
    buffer = BufferCore()
    for number in range(9):
        buffer.set_transform(edge("a", "b", 5 + number / 1000), "tests")
    assert yaml.safe_load(buffer.all_frames_as_yaml())["b"]["oldest_transform"] == 5.005
    buffer.set_transform(edge("a", "c", 5), "tests")
    buffer.set_transform(edge("a", "d", 5), "tests")
    assert buffer._getFrameStrings() == ["b", "a", "c"]
    assert "TF_TOO_MANY_FRAMES" in caplog.text


def test_one_sample_told_often_is_kept_once() -> None:
    buffer = BufferCore()
    for _ in range(5):
        buffer.set_transform(edge("a", "b", 5), "tests")
    buffer.set_transform(edge("a", "b", 5, x=2.0), "tests")
    assert yaml.safe_load(buffer.all_frames_as_yaml())["b"]["rate"] == 20_000, "two, within the 0.1 ms that tf2 takes"
    assert x_of(buffer, "a", "b", 5) == 2.0, "the one told last"


def test_what_the_tree_says_of_itself() -> None:
    buffer = BufferCore()
    buffer.set_transform(edge("map", "odom", 1), "amcl")
    buffer.set_transform(edge("map", "odom", 3), "amcl")
    buffer.set_transform_static(edge("odom", "base"), "me")
    told = yaml.safe_load(buffer.all_frames_as_yaml())
    assert told["odom"] == {
        "parent": "map",
        "broadcaster": "amcl",
        "rate": 1.0,
        "most_recent_transform": 3.0,
        "oldest_transform": 1.0,
        "buffer_length": 2.0,
    }
    assert told["base"]["parent"] == "odom"
    assert buffer.all_frames_as_string() == "Frame odom exists with parent map.\nFrame base exists with parent odom.\n"
    drawn = buffer._allFramesAsDot(at(4))
    assert '"map" -> "odom"[label="Broadcaster: amcl' in drawn
    assert drawn.count("{") == drawn.count("}")
    assert buffer._chain("map", at(0), "base", at(0), "odom") == ["base", "odom", "map"]
    assert buffer._chain("base", at(2), "map", at(2), "base") == ["map", "odom", "base"]


def test_velocities() -> None:
    buffer = BufferCore()
    for seconds in range(5):
        buffer.set_transform(edge("parent", "this", seconds, x=3.0 * seconds), "tests")
    linear, angular = buffer.lookupVelocityCore("this", "parent", at(3), at(1))
    assert linear == pytest.approx((3.0, 0.0, 0.0))
    assert angular == (0.0, 0.0, 0.0)
    turning = BufferCore()
    for step in range(5):
        angle = step * 0.1
        turned = (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))
        turning.set_transform(edge("parent", "this", 1 + step, x=0.0, turned=turned), "tests")
    linear, angular = turning.lookupVelocityFullCore("this", "parent", "parent", (0, 0, 0), "this", at(3), at(2))
    assert angular == pytest.approx((0.0, 0.0, 0.1))
    with pytest.raises(TransformException):
        buffer.lookupVelocityCore("this", "nobody", at(3), at(1))


def test_the_newest_common_time() -> None:
    pytest.importorskip("metaros.ros2.rclpy.time.time")
    buffer = BufferCore()
    buffer.set_transform(edge("a", "b", 5), "tests")
    buffer.set_transform(edge("b", "c", 4), "tests")
    buffer.set_transform_static(edge("c", "d"), "tests")
    assert buffer.get_latest_common_time("a", "d").nanoseconds == 4 * SECOND
    assert buffer.get_latest_common_time("d", "c").nanoseconds == 0
    assert buffer.get_latest_common_time("b", "b").nanoseconds == 5 * SECOND
    with pytest.raises(LookupException):
        buffer.get_latest_common_time("a", "nobody")


@pytest.fixture(autouse=True)
def heard(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "metaros.ros2.tf2")
