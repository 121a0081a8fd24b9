"""Callbacks for what happens to parameters of other nodes: which of them are called, in which order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.parameters.parameter import Parameter
from metaros.ros2.rclpy.parameters.parameter_event_handler import ParameterEventHandler
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.ros2.rclpy.parameters.conftest import MakeNode
from tests.support.waiting import wait_until


@pytest.fixture
def handler(make_node: MakeNode) -> Iterator[ParameterEventHandler]:
    """On a node in a namespace."""
    handler = ParameterEventHandler(make_node("watcher", namespace="/ns"))
    yield handler
    handler.destroy()


def event(node: str, **parameters: Any) -> Any:
    changed = [Parameter(name, value=value).to_parameter_msg() for name, value in parameters.items()]
    return interface("rcl_interfaces/msg/ParameterEvent")(node=node, changed_parameters=changed)


def tell(handler: ParameterEventHandler, node: str, **parameters: Any) -> None:
    handler._callbacks.event_callback(event(node, **parameters))


def test_who_is_called(handler: ParameterEventHandler) -> None:
    calls: list[str] = []
    handler.add_parameter_event_callback(lambda one: calls.append(f"every of {one.node}"))
    handler.add_parameter_callback("a", "/other", lambda one: calls.append(f"first {one.value.integer_value}"))
    later = handler.add_parameter_callback("a", "/other", lambda one: calls.append("later"))
    handler.add_parameter_callback("a", "near", lambda one: calls.append("near"))
    handler.add_parameter_callback("a", "", lambda one: calls.append("self"))
    tell(handler, "/other", a=1, b=2)
    tell(handler, "/other", b=2)
    tell(handler, "/ns/near", a=1)
    tell(handler, "/ns/watcher", a=1)
    handler.remove_parameter_callback(later)
    tell(handler, "/other", a=3)
    assert " | ".join(calls) == (
        "later | first 1 | every of /other | every of /other | near | every of /ns/near | self | every of /ns/watcher"
        " | first 3 | every of /other"
    )


def test_removing_twice(handler: ParameterEventHandler) -> None:
    one = handler.add_parameter_callback("a", "/other", print)
    every = handler.add_parameter_event_callback(print)
    for _ in range(2):
        handler.add_parameter_event_callback(lambda _: None)
    handler.remove_parameter_callback(one)
    handler.remove_parameter_event_callback(every)
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_callback(one)
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_event_callback(every)


def test_callbacks_may_add_and_remove_callbacks(handler: ParameterEventHandler) -> None:
    calls: list[str] = []

    def once(_: Any) -> None:
        calls.append("once")
        handler.remove_parameter_event_callback(handle)
        handler.add_parameter_callback("a", "/other", lambda one: calls.append("added"))

    handle = handler.add_parameter_event_callback(once)
    tell(handler, "/other", a=1)
    tell(handler, "/other", a=1)
    assert calls == ["once", "added"]


def test_only_some_nodes(handler: ParameterEventHandler) -> None:
    calls: list[str] = []
    handler.add_parameter_event_callback(lambda one: calls.append(one.node))
    assert handler.configure_nodes_filter(["/b"])
    tell(handler, "/a", x=1)
    tell(handler, "/b", x=1)
    assert handler.configure_nodes_filter()
    tell(handler, "/a", x=1)
    assert calls == ["/b", "/a"]


def test_reading_an_event() -> None:
    one = event("/a", x=1, y=2)
    one.deleted_parameters = [Parameter("z").to_parameter_msg()]
    assert [found.name for found in ParameterEventHandler.get_parameters_from_event(one)] == ["x", "y"]
    assert ParameterEventHandler.get_parameter_from_event(one, "y", "/a").value.integer_value == 2
    assert ParameterEventHandler.get_parameter_from_event(one, "z", "/a") is None
    assert ParameterEventHandler.get_parameter_from_event(one, "y", "/b") is None


def test_a_set_of_another_node(make_node: MakeNode, handler: ParameterEventHandler, rclpy_context: Context) -> None:
    other = make_node("other")
    other.declare_parameter("a", 0)  # which is heard, too
    heard: list[int] = []
    handler.add_parameter_callback("a", "/other", lambda one: heard.append(one.value.integer_value))
    executor = SingleThreadedExecutor(context=rclpy_context)
    executor.add_node(handler.node)
    wait_until(lambda: next(iter(other.publishers)).get_subscription_count() == 1)
    other.set_parameters([Parameter("a", value=7)])

    def spun() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return 7 in heard

    wait_until(spun)
    executor.shutdown()
