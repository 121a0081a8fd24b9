"""Parameters of rclpy nodes as others read and set them, and others' parameters as rclpy nodes do."""

from __future__ import annotations

import array
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.interfaces.rcl_interfaces.msg import ParameterEvent
from metaros.node.parameters import ParameterClient, ParameterType, Range
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.parameters.parameter import Parameter, parameter_value_to_python
from metaros.ros2.rclpy.parameters.parameter_client import AsyncParameterClient
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.ros2.rclpy.parameters.conftest import MakeNode
from tests.support.waiting import wait_until


@contextmanager
def spinning(executor: Any) -> Iterator[None]:
    """On a thread, meanwhile."""
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


@contextmanager
def native_spinning(node: metaros.Node) -> Iterator[None]:
    """The same for a node of the library."""
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    with spinning(executor):
        yield


@pytest.fixture
def executor(rclpy_context: Context) -> Iterator[SingleThreadedExecutor]:
    """One that the test adds nodes to."""
    executor = SingleThreadedExecutor(context=rclpy_context)
    yield executor
    executor.shutdown()


@pytest.fixture
def peer(ros2_router: str) -> Iterator[metaros.Node]:
    """A node of the library's own, on another session."""
    endpoint = f"tcp/127.0.0.1:{ros2_router}"
    with metaros.Context(domain_id=0, connect=endpoint, environ={}) as context:
        yield metaros.Node("peer", context=context, allow_undeclared_parameters=True)


def test_the_services_of_an_rclpy_node(
    make_node: MakeNode, executor: SingleThreadedExecutor, peer: metaros.Node
) -> None:
    node = make_node()
    descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")
    bounds = interface("rcl_interfaces/msg/FloatingPointRange")(to_value=2.0, step=0.5)
    node.declare_parameter("speed", 1.0, descriptor(floating_point_range=[bounds], description="of wheels"))
    node.declare_parameters(
        "a", [("ints", [1, 2]), ("bytes", [b"x", b"y"]), ("open", None, descriptor(dynamic_typing=True))]
    )
    node.declare_parameter("typed", Parameter.Type.STRING)
    executor.add_node(node)
    given: list[Any] = []
    node.add_post_set_parameters_callback(lambda parameters: given.extend(one.value for one in parameters))
    client = ParameterClient(peer, "/base")
    with spinning(executor):
        assert client.wait()
        assert client.get(["a.ints", "a.bytes", "speed"]) == {"a.ints": [1, 2], "a.bytes": b"xy", "speed": 1.0}
        assert client.get(["a.ints", "typed"]) == {"a.ints": None, "typed": None}
        assert client.types(["a.bytes", "a.open"]) == {
            "a.bytes": ParameterType.BYTE_ARRAY,
            "a.open": ParameterType.NOT_SET,
        }
        assert client.list(["a"]) == ["a.ints", "a.bytes", "a.open"]
        described = client.describe(["speed", "typed"])
        assert (described["speed"].range, described["speed"].description) == (Range(0.0, 2.0, 0.5), "of wheels")
        assert described["typed"].kind is ParameterType.STRING
        assert client.describe(["speed", "none"]) == {}
        results = client.set({"speed": 1.5, "a.ints": [3], "typed": 1, "none": 1, "a.open": b"z"})
        assert [name for name, result in results.items() if result] == ["speed", "a.ints", "a.open"]
        assert results["typed"].reason.startswith("Wrong parameter type")
        assert "none" in results["none"].reason
        assert not client.set_atomically({"speed": 0.5, "a.ints": "x"})
        assert client.set({"a.open": None})["a.open"]
    assert given == [1.5, array.array("q", [3]), [b"z"], None]
    assert node.get_parameter("speed").value == 1.5
    assert not node.has_parameter("a.open")


def test_a_client_of_a_node_of_the_library(
    make_node: MakeNode, executor: SingleThreadedExecutor, peer: metaros.Node, tmp_path: Path
) -> None:
    peer.declare_parameter("speed", 1.0, minimum=0.0)
    peer.declare_parameter("free", 1, dynamic_typing=True)
    node = make_node()
    executor.add_node(node)
    client = AsyncParameterClient(node, "peer")
    done: list[Any] = []

    def wait(future: Any) -> Any:
        executor.spin_until_future_complete(future, timeout_sec=10.0)
        return future.result()

    with native_spinning(peer):
        assert client.wait_for_services(10.0)
        assert client.services_are_ready()
        values = wait(client.get_parameters(["speed", "free"], callback=done.append)).values
        assert [parameter_value_to_python(value) for value in values] == [1.0, 1]
        assert [future.done() for future in done] == [True]
        assert "speed" in wait(client.list_parameters(["speed"], 1)).result.names
        assert wait(client.describe_parameters(["speed"])).descriptors[0].floating_point_range[0].from_value == 0.0
        assert list(wait(client.get_parameter_types(["speed", "free"])).types) == [3, 2]
        sets = [Parameter("speed", value=-1.0), Parameter("free", value="x").to_parameter_msg()]
        assert [one.successful for one in wait(client.set_parameters(sets)).results] == [False, True]
        assert not wait(client.set_parameters_atomically(sets)).result.successful
        assert wait(client.delete_parameters(["free"])).results[0].successful
        file = tmp_path / "parameters.yaml"
        file.write_text("any: {ros__parameters: {speed: 2.5, new: [a]}}")
        assert all(one.successful for one in wait(client.load_parameter_file(str(file))).results)
        assert wait(client.load_parameter_file_atomically(str(file))).result.successful
    assert (peer.parameters["speed"], peer.parameters["new"], "free" in peer.parameters) == (2.5, ["a"], False)


def test_a_client_without_a_peer(make_node: MakeNode) -> None:
    client = AsyncParameterClient(make_node(), "nobody")
    assert not client.services_are_ready()
    assert not client.wait_for_services(0.01)


def test_events(make_node: MakeNode, peer: metaros.Node) -> None:
    heard: list[tuple[str, str, Any]] = []

    def hear(event: ParameterEvent) -> None:
        for kind in ("new", "changed", "deleted"):
            parameters = getattr(event, f"{kind}_parameters")
            heard.extend((event.node, f"{kind} {one.name}", parameter_value_to_python(one.value)) for one in parameters)
        stamps.append(event.stamp.sec)

    stamps: list[int] = []
    node = make_node("eventful")
    peer.create_subscription(ParameterEvent, "/parameter_events", hear)
    publisher = next(iter(node.publishers))
    wait_until(lambda: publisher.get_subscription_count() == 1)
    with native_spinning(peer):
        node.declare_parameter("a", 1, interface("rcl_interfaces/msg/ParameterDescriptor")(dynamic_typing=True))
        node.declare_parameter("b", Parameter.Type.STRING)
        node.set_parameters_atomically([Parameter("a", value=2), Parameter("b", value="x")])
        node.set_parameters([Parameter("a")])
        node.set_parameters([Parameter("b", value=1)])  # refused: not told
        node.undeclare_parameter("b")  # not told either, as in rclpy
        make_node("late")
        wait_until(lambda: any(name == "/late" for name, *_ in heard))
    assert [one[1:] for one in heard if one[0] == "/eventful"] == [
        ("new a", 1),
        ("new b", None),
        ("new b", "x"),
        ("changed a", 2),
        ("deleted a", None),
    ]
    assert ("/late", "new use_sim_time", False) in heard
    assert all(abs(sec - node.get_clock().now().nanoseconds // 1_000_000_000) < 60 for sec in stamps)
