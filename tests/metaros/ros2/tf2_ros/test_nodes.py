"""Broadcasters, listeners and the buffer client, over the wire."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.ros2 import message_filters
from metaros.ros2.rclpy.action.server import ActionServer
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import MultiThreadedExecutor, SingleThreadedExecutor
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import transform_stamped
from metaros.ros2.tf2_ros import (
    Buffer,
    BufferClient,
    BufferCore,
    LookupException,
    StaticTransformBroadcaster,
    StaticTransformListener,
    TimeoutException,
    TransformBroadcaster,
    TransformException,
    TransformListener,
)
from tests.support.waiting import wait_until

LONG = Duration(seconds=30)
Nodes = Callable[[str], Node]


def edge(parent: str, child: str, x: float = 1.0, time: Time | None = None) -> Any:
    stamp_ns = 0 if time is None else time.nanoseconds
    return transform_stamped(parent, child, stamp_ns, ((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))


@pytest.fixture
def nodes(rclpy_context: Context, request: pytest.FixtureRequest) -> Iterator[Nodes]:
    """Makes nodes whose /tf and /tf_static are the test's own."""
    made: list[Node] = []
    own = f"/t{abs(hash(request.node.name)) % 10**8}"

    def make(name: str) -> Node:
        rules = ["--ros-args", "-r", f"/tf:={own}/tf", "-r", f"/tf_static:={own}/tf_static"]
        node = Node(name, context=rclpy_context, cli_args=rules, start_parameter_services=False, enable_rosout=False)
        made.append(node)
        return node

    yield make
    for node in made:
        node.destroy_node()


@pytest.fixture
def spun(rclpy_context: Context) -> Iterator[Callable[[Node], None]]:
    """Spins nodes in another thread."""
    executor = MultiThreadedExecutor(num_threads=2, context=rclpy_context)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield executor.add_node
    executor.shutdown()
    thread.join()


def test_what_is_told_is_looked_up(nodes: Nodes, spun: Callable[[Node], None]) -> None:
    teller, hearer = nodes("teller"), nodes("hearer")
    buffer = Buffer(node=hearer)
    TransformListener(buffer, hearer)
    spun(hearer)
    moving, fixed = TransformBroadcaster(teller), StaticTransformBroadcaster(teller)
    fixed.sendTransform(edge("base", "laser", 0.5))
    fixed.sendTransform((edge("base", "camera", 0.25), edge("base", "laser", 2.0)))
    wait_until(lambda: moving.pub_tf.get_subscription_count() == 1)
    now = teller.get_clock().now()
    moving.sendTransform(edge("map", "base", 3.0, now))
    assert buffer.lookup_transform("base", "camera", Time(), LONG).transform.translation.x == 0.25
    assert buffer.lookup_transform("map", "laser", now, LONG).transform.translation.x == 5.0, "of the second message"
    late = Buffer()
    listener = StaticTransformListener(late, hearer)
    assert late.can_transform("camera", "laser", Time(), LONG), "the last message has them all"
    assert not late.can_transform("map", "laser", Time())
    listener.unregister()
    listener.unregister()


def test_frames_are_told_by_a_service(nodes: Nodes, spun: Callable[[Node], None]) -> None:
    node = nodes("with_frames")
    buffer = Buffer(node=node)
    buffer.set_transform_static(edge("map", "base"), "tests")
    spun(node)
    client = node.create_client(interface("tf2_msgs/srv/FrameGraph"), "tf2_frames")
    assert client.wait_for_service(30.0)
    answer = client.call(interface("tf2_msgs/srv/FrameGraph").Request(), 30.0)
    assert "parent: 'map'" in answer.frame_yaml


def test_a_listener_with_a_thread_of_its_own(nodes: Nodes, rclpy_context: Context) -> None:
    teller, hearer = nodes("teller"), nodes("hearer")
    buffer = Buffer()
    listener = TransformListener(buffer, hearer, spin_thread=True)
    StaticTransformBroadcaster(teller).sendTransform([edge("map", "base")])
    assert buffer.can_transform("map", "base", Time(), LONG)
    thread = listener.dedicated_listener_thread
    listener.__del__()
    assert not thread.is_alive()


def test_a_callback_waits_for_a_transform_without_keeping_the_executor(nodes: Nodes, rclpy_context: Context) -> None:
    node, teller = nodes("waiting"), nodes("teller")
    buffer = Buffer()
    TransformListener(buffer, node)
    found: list[Any] = []

    async def look_up() -> None:
        timer.cancel()
        found.append(await buffer.lookup_transform_async("map", "base", Time()))

    timer = node.create_timer(0.001, look_up)
    broadcaster = StaticTransformBroadcaster(teller)
    with SingleThreadedExecutor(context=rclpy_context) as executor:
        executor.add_node(node)
        while not timer.is_canceled():
            executor.spin_once(timeout_sec=10.0)
        broadcaster.sendTransform(edge("map", "base", 7.0))
        for _ in range(100):
            if found:
                break
            executor.spin_once(timeout_sec=1.0)
        executor.remove_node(node)
    assert found[0].transform.translation.x == 7.0


def test_messages_of_two_topics_are_put_together(nodes: Nodes, spun: Callable[[Node], None]) -> None:
    node = nodes("putting_together")
    kind = interface("geometry_msgs/msg/PointStamped")
    subscribers = [message_filters.Subscriber(node, kind, f"{node.get_name()}/{side}") for side in ("left", "right")]
    together: list[tuple[Any, ...]] = []
    synchronizer = message_filters.ApproximateTimeSynchronizer(subscribers, 10, 0.5)
    synchronizer.registerCallback(lambda *messages: together.append(messages))
    spun(node)
    publishers = [node.create_publisher(kind, subscriber.topic_name, 10) for subscriber in subscribers]
    wait_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in publishers))
    for seconds, publisher in ((1, publishers[0]), (3, publishers[1]), (3, publishers[0])):
        message = kind()
        message.header.stamp.sec, message.point.x = seconds, float(seconds)
        publisher.publish(message)
    wait_until(lambda: bool(together))
    assert [message.point.x for message in together[0]] == [3.0, 3.0]


def test_a_buffer_elsewhere_is_asked_by_its_action(nodes: Nodes, spun: Callable[[Node], None]) -> None:
    kind, error = interface("tf2_msgs/action/LookupTransform"), interface("tf2_msgs/msg/TF2Error")
    core = BufferCore()
    core.set_transform_static(edge("map", "base", 4.0), "tests")
    asked: list[Any] = []

    def serve(handle: Any) -> Any:
        goal = handle.request
        asked.append(goal)
        result = kind.Result()
        try:
            result.transform = core.lookup_transform_core(goal.target_frame, goal.source_frame, goal.source_time)
        except TransformException as failed:
            result.error = error(error=error.LOOKUP_ERROR, error_string=str(failed))
        handle.succeed()
        return result

    node, server_node = nodes("asking"), nodes("serving")
    client = BufferClient(node, "tf_of_elsewhere", timeout_padding=30.0)
    with pytest.raises(TimeoutException, match="not ready"):
        client.lookup_transform("map", "base", Time())
    server = ActionServer(server_node, kind, "tf_of_elsewhere", serve)
    spun(node)
    spun(server_node)
    wait_until(client.action_client.server_is_ready)
    assert client.lookup_transform("map", "base", Time(), LONG).transform.translation.x == 4.0
    assert client.can_transform("base", "map", Time())
    with pytest.raises(LookupException, match='"nobody"'):
        client.lookup_transform("map", "nobody", Time())
    assert not client.can_transform_full("map", Time(), "nobody", Time(), "base")
    assert (asked[0].timeout.sec, asked[-1].advanced, asked[-1].fixed_frame) == (30, True, "base")
    with pytest.warns(UserWarning, match="deprecated"):
        client.lookup_transform("map", "base", Time().to_msg())
    with pytest.raises(TypeError, match=r"rclpy\.time\.Time"):
        client.lookup_transform("map", "base", 1.0)
    server.destroy()
    client.action_client.destroy()
