"""Simulated time of a node, by its parameter and /clock."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.time.clock import Clock, JumpThreshold, ROSClock
from metaros.ros2.rclpy.time.clock_type import ClockChange, ClockType
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rclpy.time.time_source import CLOCK_TOPIC, TimeSource
from metaros.ros2.rosidl.catalogue import interface


@pytest.fixture
def node(rclpy_context: Context) -> Iterator[Node]:
    """With parameters, and no services for them."""
    with Node("simulated", context=rclpy_context, start_parameter_services=False, enable_rosout=False) as node:
        yield node


@pytest.fixture
def executor(node: Node, rclpy_context: Context) -> Iterator[SingleThreadedExecutor]:
    """Of the node."""
    with SingleThreadedExecutor(context=rclpy_context) as executor:
        executor.add_node(node)
        yield executor


def _use_sim_time(node: Node, value: Any) -> bool:
    """Whether the parameter could be set so."""
    result: bool = node.set_parameters([Parameter("use_sim_time", value=value)])[0].successful
    return result


def _say(node: Node, executor: SingleThreadedExecutor, seconds: int) -> None:
    """On /clock, and until the node has heard it."""
    clock = interface("rosgraph_msgs/msg/Clock")
    publisher = node.create_publisher(clock, CLOCK_TOPIC, 1)
    publisher.publish(clock(clock=Time(seconds=seconds).to_msg()))
    executor.spin_once(timeout_sec=5)
    node.destroy_publisher(publisher)


def test_clocks_follow_the_parameter_and_the_topic(node: Node, executor: SingleThreadedExecutor) -> None:
    source, clock = TimeSource(node=node), ROSClock()
    clock._set_ros_time_is_active(True)
    source.attach_clock(clock)
    assert (source.ros_time_is_active, clock.ros_time_is_active, source._clock_sub) == (False, False, None)
    assert _use_sim_time(node, True)
    assert (source.ros_time_is_active, clock.ros_time_is_active) == (True, True)
    assert source._clock_sub is not None
    assert clock.now() == Time(clock_type=ClockType.ROS_TIME)
    node.destroy_subscription(node._time_source._clock_sub)  # the node's own: this one is to hear the message
    _say(node, executor, 5)
    assert clock.now() == Time(seconds=5, clock_type=ClockType.ROS_TIME)
    late = Clock(clock_type=ClockType.ROS_TIME)
    source.attach_clock(late)  # type: ignore[arg-type]
    assert late.now() == clock.now()
    assert _use_sim_time(node, False)
    assert abs(clock.now().nanoseconds - Clock().now().nanoseconds) < 5e9
    assert source._clock_sub is None


def test_jumps_of_the_simulation_are_told(node: Node, executor: SingleThreadedExecutor) -> None:
    clock, told = node.get_clock(), list[Any]()
    threshold = JumpThreshold(min_forward=Duration(seconds=0.5), min_backward=Duration(seconds=-0.5))
    assert _use_sim_time(node, True)
    with clock.create_jump_callback(
        threshold, post_callback=lambda jump: told.append((jump.clock_change, jump.delta.nanoseconds / 1e9))
    ):
        for seconds in (5, 5, 3):
            _say(node, executor, seconds)
        for value in (False, False, True):
            _use_sim_time(node, value)
    assert told == [
        (ClockChange.ROS_TIME_NO_CHANGE, 5),
        (ClockChange.ROS_TIME_NO_CHANGE, -2),
        (ClockChange.ROS_TIME_DEACTIVATED, 0),
        (ClockChange.ROS_TIME_ACTIVATED, 0),
    ]


def test_timers_of_a_node_run_by_the_simulation(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[int]()
    assert _use_sim_time(node, True)
    node.create_timer(2, lambda: calls.append(node.get_clock().now().nanoseconds // 10**9))
    for seconds in (1, 2, 3, 5):
        _say(node, executor, seconds)
        executor.spin_once(timeout_sec=0)
    assert calls == [2, 5]


def test_a_callback_may_await_what_the_simulation_brings(node: Node, executor: SingleThreadedExecutor) -> None:
    assert _use_sim_time(node, True)
    later, group = Future[Any](), ReentrantCallbackGroup()
    node.create_timer(2, lambda: later.set_result("later"), callback_group=group)
    heard = list[Any]()

    async def wait() -> None:
        heard.append(await later)

    guard = node.create_guard_condition(wait)  # in the node's own group, which it holds meanwhile
    guard.trigger()
    executor.spin_once(timeout_sec=0)
    _say(node, executor, 2)
    for _ in range(2):
        executor.spin_once(timeout_sec=0)
    assert heard == ["later"]


def test_what_cannot_be_attached_or_set(node: Node) -> None:
    source = TimeSource(node=node)
    for kind in (ClockType.SYSTEM_TIME, ClockType.STEADY_TIME):
        with pytest.raises(ValueError, match="ROS_TIME"):
            source.attach_clock(Clock(clock_type=kind))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="Node must be"):
        source.attach_node("node")
    assert not _use_sim_time(node, "yes")
    assert _use_sim_time(node, True)


def test_a_detached_node_is_asked_no_more(node: Node, rclpy_context: Context) -> None:
    source, clock = TimeSource(node=node), ROSClock()
    source.attach_clock(clock)
    assert _use_sim_time(node, True)
    source.detach_node()
    assert (source._get_node(), source._clock_sub, source.ros_time_is_active) == (None, None, False)
    for value in (False, True):
        assert _use_sim_time(node, value)
    assert not source.ros_time_is_active
    with Node("other", context=rclpy_context, start_parameter_services=False, enable_rosout=False) as other:
        source.attach_node(other)
        assert source._get_node() is other
        assert source._clock_sub is None
        assert _use_sim_time(other, True)
        assert clock.ros_time_is_active
