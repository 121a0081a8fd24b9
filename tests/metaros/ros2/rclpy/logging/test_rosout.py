"""Which loggers publish on /rosout, what, and for how long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.logging import loggers, rosout
from metaros.ros2.rclpy.logging.rosout import ROSOUT, Rosout
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rosidl.catalogue import interface
from tests.support.nodes.threads import on_thread
from tests.support.waiting import wait_until

Heard = Callable[[str], list[Any]]


@pytest.fixture(name="node")
def _node(rclpy_context: Context) -> Iterator[Node]:
    with Node("voice", namespace="/ns", context=rclpy_context) as node:
        yield node


@pytest.fixture(name="heard")
def _heard(node: Node, rclpy_context: Context) -> Iterator[Heard]:
    """What came on /rosout until a message with that text."""
    messages: list[Any] = []
    node.create_subscription(interface("rcl_interfaces/msg/Log"), "/rosout", messages.append, 100)
    executor = SingleThreadedExecutor(context=rclpy_context)
    executor.add_node(node)

    def until(last: str) -> list[Any]:
        def there() -> bool:
            executor.spin_once(timeout_sec=0.05)
            return any(message.msg == last for message in messages)

        wait_until(there, every_s=0.0)
        return messages

    yield until
    executor.shutdown()


def test_node_loggers_and_their_children_publish(node: Node, heard: Heard) -> None:
    logger = node.get_logger()
    logger.debug("too low")
    logger.warning("mine")
    logger.get_child("arm").get_child("hand").info("a child's")
    loggers.get_logger("other").info("nobody's")
    loggers.get_logger("ns.voice").info("last")
    found = [(message.name, message.msg, message.level) for message in heard("last")]
    assert found == [("ns.voice", "mine", 30), ("ns.voice.arm.hand", "a child's", 20), ("ns.voice", "last", 20)]


def test_messages_tell_where_they_are_from(node: Node, heard: Heard) -> None:
    node.get_logger().info("here")
    (message,) = heard("here")
    assert (message.file, message.function) == (__file__, "test_messages_tell_where_they_are_from")
    assert message.line > 0
    assert message.stamp.sec > 1_000_000_000


def test_children_publish_as_long_as_somebody_has_them(node: Node) -> None:
    first, second = node.get_logger().get_child("arm"), node.get_logger().get_child("arm")
    del first
    assert ROSOUT.knows("ns.voice.arm")
    del second
    assert not ROSOUT.knows("ns.voice.arm")


def test_the_loggers_of_a_node_that_is_gone_have_no_children(node: Node, rclpy_context: Context) -> None:
    with Node("gone", context=rclpy_context) as other:
        logger = other.get_logger()
        child = logger.get_child("child")
    assert not ROSOUT.knows("gone")
    assert not ROSOUT.knows("gone.child")
    assert child.info("to the terminal alone")
    with pytest.raises(RuntimeError, match="is gone"):
        logger.get_child("child")


def test_the_node_of_the_library_goes_by_the_same_level(node: Node, rclpy_context: Context) -> None:
    native = node.handle.get_logger()
    levels = [native.level]
    for name, level in (("ns.voice", LoggingSeverity.ERROR), ("ns.voice", LoggingSeverity.UNSET), ("", 10)):
        loggers.set_logger_level(name, level)
        levels.append(native.level)
    assert levels == [20, 40, 20, 10]
    with Node("late", context=rclpy_context) as late:
        assert late.handle.get_logger().level == 10
    arguments = ["--ros-args", "--log-level", "fatal"]
    with Node("loud", context=rclpy_context, cli_args=arguments) as loud:
        assert loud.get_logger().get_effective_level() is LoggingSeverity.FATAL


def test_a_node_without_rosout_is_silent_there(rclpy_context: Context) -> None:
    with Node("mute", context=rclpy_context, enable_rosout=False) as node:
        assert node.get_logger().info("to the terminal alone")
        assert node.get_publishers_info_by_topic("/rosout") == []


def test_a_logger_may_be_collected_in_the_middle_of_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its `__del__` removes it, on the thread where the garbage collector happens to run."""
    table, node = Rosout(), SimpleNamespace(abandoned=False)
    table._entries["voice"] = rosout._Entry(node)
    assert table.add_child("voice", "old")

    class Entry(rosout._Entry):
        def __init__(self, node: Any) -> None:
            super().__init__(node)
            table.remove_child("voice.old")

    monkeypatch.setattr(rosout, "_Entry", Entry)
    thread, raised = on_thread(lambda: table.add_child("voice", "new"))
    thread.join(10.0)
    assert (thread.is_alive(), raised) == (False, [])
    assert (table.knows("voice.old"), table.knows("voice.new")) == (False, True)
    table.detach(node)
    assert not table.knows("voice")
