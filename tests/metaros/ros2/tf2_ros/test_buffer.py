"""Buffers that wait, and objects that go through them; without a node."""

from __future__ import annotations

import logging
import threading
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.time.clock import Clock, ClockType, ROSClock
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import transform_stamped
from metaros.ros2.tf2_ros import (
    Buffer,
    BufferClient,
    BufferInterface,
    ConnectivityException,
    ConvertRegistration,
    ExtrapolationException,
    LookupException,
    NotImplementedException,
    Stamped,
    TimeoutException,
    TransformRegistration,
    TypeException,
    convert,
)
from tests.support.nodes.threads import on_thread
from tests.support.waiting import wait_until

NOW = Time(seconds=5)


def edge(parent: str = "foo", child: str = "bar", time: Time = NOW, x: float = 42.0) -> Any:
    return transform_stamped(parent, child, time.nanoseconds, ((x, -3.0, 0.0), (0.0, 0.0, 0.0, 1.0)))


def later(buffer: Buffer, act: Any) -> threading.Thread:
    """Do it when somebody waits for news of the buffer."""

    def run() -> None:
        wait_until(lambda: bool(buffer._Buffer__watchers))  # type: ignore[attr-defined]
        act()

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def test_what_is_there_is_given_at_once() -> None:
    buffer = Buffer(Duration(seconds=3))
    buffer.set_transform(edge(), "tests")
    assert buffer.lookup_transform("foo", "bar", NOW) == edge()
    assert buffer.lookup_transform("foo", "bar", NOW.to_msg(), timeout=Duration(seconds=100)) == edge()
    assert buffer.lookup_transform_full("foo", NOW, "bar", NOW, "foo") == edge()
    assert buffer.can_transform("foo", "bar", NOW) is True
    assert buffer.can_transform_full("foo", NOW, "bar", NOW, "foo", return_debug_tuple=True) == (True, "")
    able, why = buffer.can_transform("foo", "bar", Time(seconds=6), return_debug_tuple=True)
    assert (able, "extrapolation" in why) == (False, True)


def test_a_lookup_waits_for_what_comes_in_time() -> None:
    buffer = Buffer()
    thread = later(buffer, lambda: buffer.set_transform(edge(), "tests"))
    assert buffer.lookup_transform("foo", "bar", NOW, Duration(seconds=20)).child_frame_id == "bar"
    thread.join()
    thread = later(buffer, lambda: buffer.set_transform_static(edge("bar", "baz"), "tests"))
    assert buffer.can_transform_full("foo", NOW, "baz", NOW, "bar", Duration(seconds=20))
    thread.join()
    assert buffer._Buffer__watchers == {}  # type: ignore[attr-defined]


def test_a_lookup_that_waited_in_vain_says_what_tf2_says() -> None:
    buffer = Buffer()
    buffer.set_transform(edge(), "tests")
    short = Duration(nanoseconds=1_000_000)
    with pytest.raises(LookupException):
        buffer.lookup_transform("foo", "nobody", NOW, short)
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform_full("foo", Time(seconds=9), "bar", NOW, "bar", short)
    assert buffer.can_transform("foo", "bar", Time(seconds=9), short) is False
    with pytest.raises(TypeError, match="duration must have"):
        buffer.lookup_transform("foo", "bar", NOW, 0.5)


def test_futures_of_transforms() -> None:
    buffer = Buffer()
    futures = [
        buffer.wait_for_transform_async("foo", "bar", NOW),
        buffer.wait_for_transform_full_async("foo", NOW, "bar", NOW, "foo"),
        buffer.wait_for_transform_async("foo", "never", NOW),
    ]
    buffer.set_transform(edge("foo", "other"), "tests")
    assert [future.done() for future in futures] == [False] * 3
    buffer.set_transform(edge(), "tests")
    assert [future.done() for future in futures] == [True, True, False]
    assert futures[0].result() == futures[1].result() == edge()
    assert buffer.wait_for_transform_async("foo", "bar", NOW).result() == edge()
    futures[2].cancel()
    assert buffer._Buffer__watchers == {}, "nobody watches any more"  # type: ignore[attr-defined]


def test_coroutines_wait_too() -> None:
    buffer = Buffer()
    waiting = [
        buffer.lookup_transform_async("foo", "bar", NOW),
        buffer.lookup_transform_full_async("foo", NOW, "bar", NOW, "foo"),
    ]
    for coroutine in waiting:
        coroutine.send(None)
    buffer.set_transform(edge(), "tests")
    for coroutine in waiting:
        with pytest.raises(StopIteration) as ended:
            coroutine.send(None)
        assert ended.value.value == edge()


def test_a_clock_that_jumps_back_empties_the_buffer(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "metaros.ros2.tf2")
    clock: Any = ROSClock()
    node = SimpleNamespace(get_clock=lambda: clock, create_service=lambda *args: args)
    buffer = Buffer(node=node)
    clock._set_ros_time_is_active(True)
    clock.set_ros_time_override(Time(seconds=8, clock_type=ClockType.ROS_TIME))
    buffer.set_transform(edge(), "tests")
    caplog.clear()
    clock.set_ros_time_override(Time(seconds=7.5, clock_type=ClockType.ROS_TIME))
    assert buffer.can_transform("foo", "bar", Time()), "half a second is no new recording"
    clock.set_ros_time_override(Time(seconds=6, clock_type=ClockType.ROS_TIME))
    with pytest.raises(ConnectivityException):
        buffer.lookup_transform("foo", "bar", Time())
    assert "jump back in time" in caplog.text
    kind, name, tell = buffer.srv
    assert (kind, name) == (interface("tf2_msgs/srv/FrameGraph"), "tf2_frames")
    assert tell(None, SimpleNamespace()).frame_yaml == ""


def test_lookups_end_with_the_context_of_their_node(monkeypatch: pytest.MonkeyPatch) -> None:
    server = SimpleNamespace(server_is_ready=lambda: True, send_goal_async=lambda goal: Future())
    monkeypatch.setattr("metaros.ros2.rclpy.action.client.ActionClient", lambda *args, **options: server)
    context, hour = Context(), Duration(seconds=3600)
    context.init(args=[])
    node = SimpleNamespace(context=context, get_clock=Clock, create_service=lambda *args: args)
    buffers = {LookupException: Buffer(node=node), TimeoutException: BufferClient(node, "buffer")}
    threads = {
        kind: on_thread(partial(buffer.lookup_transform, "foo", "bar", Time(), timeout=hour))
        for kind, buffer in buffers.items()
    }
    wait_until(lambda: len(context._wakers) == len(threads))
    context._end_by_signal()
    for kind, (thread, raised) in threads.items():
        thread.join(20.0)
        assert (thread.is_alive(), [type(found) for found in raised]) == (False, [kind])
    assert len(context._wakers) == 0
    context.shutdown()


def test_objects_go_through_the_buffer() -> None:
    import metaros.ros2.tf2_geometry_msgs
    import metaros.ros2.tf2_sensor_msgs
    from metaros.ros2.sensor_msgs_py.point_cloud2 import create_cloud_xyz32, read_points_numpy

    assert metaros.ros2.tf2_geometry_msgs.do_transform_point is not None
    assert metaros.ros2.tf2_sensor_msgs.do_transform_cloud is not None
    buffer = Buffer()
    buffer.set_transform_static(edge(x=1.0), "tests")
    point = interface("geometry_msgs/msg/PointStamped")()
    point.header.frame_id, point.header.stamp.sec, point.point.x = "bar", 7, 2.0
    found = buffer.transform(point, "foo")
    assert (found.point.x, found.point.y, found.header.frame_id, found.header.stamp.sec) == (3.0, -3.0, "foo", 7)
    assert point.point.x == 2.0
    again = buffer.transform(point, "foo", new_type=interface("geometry_msgs/msg/PointStamped"))
    assert again == found
    over = buffer.transform_full(point, "foo", Time(seconds=9), "foo")
    assert (over.point.x, over.header.stamp.sec) == (3.0, 9)
    cloud = create_cloud_xyz32(interface("std_msgs/msg/Header")(frame_id="bar"), [(1.0, 2.0, 3.0)])
    moved = buffer.transform(cloud, "foo")
    assert moved.header.frame_id == "foo"
    np.testing.assert_array_equal(read_points_numpy(moved), [[2.0, -1.0, 3.0]])


def test_types_that_nobody_knows() -> None:
    buffer = Buffer()
    image = interface("sensor_msgs/msg/Image")()
    with pytest.raises(TypeException, match="not loaded or supported: import tf2_sensor_msgs") as raised:
        buffer.transform(image, "foo")
    assert "Image" in raised.value.errstr
    registry = TransformRegistration()
    with pytest.raises(TypeException):
        registry.get(int)

    class Mine:
        pass

    class Yours(Mine):
        pass

    registry.add(Mine, lambda thing, transform: (thing, transform))
    assert registry.get(Mine)(1, 2) == (1, 2)
    table = ConvertRegistration()
    with pytest.raises(TypeException):
        convert(Mine(), Yours)
    table.add_to_msg(Mine, lambda thing: "message")
    table.add_from_msg(Yours, lambda message: message + " of yours")
    assert convert(Mine(), Yours) == "message of yours"
    table.add_convert((Mine, Yours), lambda thing: "directly")
    assert convert(Mine(), Yours) == "directly"
    assert isinstance(convert(Yours(), Yours), Yours)


def test_what_is_no_buffer_says_so_and_headers_are_put_on() -> None:
    for act in (
        lambda: BufferInterface().lookup_transform("a", "b", NOW),
        lambda: BufferInterface().lookup_transform_full("a", NOW, "b", NOW, "c"),
        lambda: BufferInterface().can_transform("a", "b", NOW),
        lambda: BufferInterface().can_transform_full("a", NOW, "b", NOW, "c"),
    ):
        with pytest.raises(NotImplementedException, match="not implemented"):
            act()
    point = Stamped(interface("geometry_msgs/msg/PointStamped")(), NOW.to_msg(), "map")
    assert (point.header.frame_id, point.header.stamp.sec) == ("map", 5)
