"""Nodes: names, what they create and destroy, and the errors of rclpy. Nobody spins here."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy import create_node
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.rcl_errors import (
    InvalidHandle,
    RCLError,
    RCLInvalidROSArgsError,
    UnknownROSArgsError,
    UnsupportedError,
)
from metaros.ros2.rclpy.core.wait_for_message import wait_for_message
from metaros.ros2.rclpy.names.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
    NotInitializedException,
)
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until

STRING = "std_msgs/msg/String"
ADD = "example_interfaces/srv/AddTwoInts"


@pytest.fixture(name="own_context")
def _own_context(ros2_router: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    """A context of the test's own, not yet initialised."""
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    context = Context()
    yield context
    context.try_shutdown()


@pytest.fixture(name="node")
def _node(rclpy_context: Context) -> Iterator[Node]:
    with create_node("probe", context=rclpy_context, namespace="/lab") as node:
        yield node


def test_names(rclpy_context: Context) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({}, "/name"),
        ({"namespace": ""}, "/name"),
        ({"namespace": "ns"}, "/ns/name"),
        ({"namespace": "/ns/deep"}, "/ns/deep/name"),
        ({"cli_args": ["--ros-args", "-r", "__ns:=/foo/bar"]}, "/foo/bar/name"),
        ({"cli_args": ["-r", "__node:=other"], "namespace": "ns"}, "/ns/other"),
    ]
    found = []
    for options, _ in cases:
        with create_node("name", context=rclpy_context, **options) as node:
            name = node.get_fully_qualified_name()
            assert name == f"{node.get_namespace().rstrip('/')}/{node.get_name()}"
            assert node.get_logger().name == name.lstrip("/").replace("/", ".")
            found.append(name)
    assert found == [name for _, name in cases]


def test_names_that_are_none(rclpy_context: Context) -> None:
    with pytest.raises(InvalidNodeNameException, match="must not contain characters"):
        create_node("what?", context=rclpy_context)
    for namespace in ("what?", "/what?"):
        with pytest.raises(InvalidNamespaceException, match="must not contain characters"):
            create_node("name", context=rclpy_context, namespace=namespace)
    with pytest.raises(NotInitializedException, match="cannot create node"):
        create_node("name", context=Context())
    with pytest.raises(RCLInvalidROSArgsError, match=r"Failed to parse ROS arguments:.*not-a-remap"):
        create_node("name", context=rclpy_context, cli_args=["--ros-args", "-r", "not-a-remap"])
    with pytest.raises(UnknownROSArgsError, match=r"\['--my-flag'\]"):
        create_node("name", context=rclpy_context, cli_args=["--ros-args", "--my-flag"])


def test_arguments_of_the_context_count_unless_the_node_says_no(own_context: Context) -> None:
    own_context.init(args=["--ros-args", "-r", "__node:=global_name", "-r", "foo:=bar"])
    with create_node("mine", context=own_context, namespace="/ns") as node:
        assert node.get_name() == "global_name"
        assert [node.resolve_topic_name("foo"), node.resolve_service_name("foo")] == ["/ns/bar"] * 2
        assert node.resolve_topic_name("foo", only_expand=True) == "/ns/foo"
    with create_node("mine", context=own_context, use_global_arguments=False) as node:
        assert node.get_name() == "mine"
        assert node.resolve_topic_name("foo") == "/foo"


def test_a_topic_is_remapped_once(rclpy_context: Context) -> None:
    with create_node("swap", context=rclpy_context, cli_args=["-r", "a:=b", "-r", "b:=c"]) as node:
        assert node.create_publisher(interface(STRING), "a", 1).topic_name == "/b"
        assert node.create_subscription(interface(STRING), "{node}/x", print, 1).topic_name == "/swap/x"
        assert node.create_client(interface(ADD), "b").service_name == "/c"
        assert node.create_service(interface(ADD), "~/add", lambda a, b: b).service_name == "/swap/add"


def test_endpoints_and_their_errors(node: Node) -> None:
    string, add = interface(STRING), interface(ADD)

    def create(kind: str, name: str, qos: Any = 1) -> Any:
        made: dict[str, Any] = {
            "publisher": lambda: node.create_publisher(string, name, qos),
            "subscription": lambda: node.create_subscription(string, name, print, qos),
            "client": lambda: node.create_client(add, name),
            "service": lambda: node.create_service(add, name, lambda a, b: b),
        }
        return made[kind]()

    for kind in ("publisher", "subscription", "client", "service"):
        topic = kind in ("publisher", "subscription")
        error = InvalidTopicNameException if topic else InvalidServiceNameException
        with pytest.raises(error, match="must not contain characters"):
            create(kind, "chatter?")
        with pytest.raises(error, match="must not start with a number"):
            create(kind, "/chatter/42_is")
        with pytest.raises(ValueError, match="unknown substitution"):
            create(kind, "chatter/{bad_sub}")
        if topic:
            with pytest.raises(ValueError, match="must be greater than or equal to zero"):
                create(kind, "chatter", -1)
            with pytest.raises(TypeError, match="Expected QoSProfile or int"):
                create(kind, "chatter", "foo")
    with pytest.raises(AttributeError, match="no message"):
        node.create_publisher(str, "chatter", 1)
    with pytest.raises(RuntimeError, match="not valid"):
        node.create_publisher(add, "chatter", 1)
    with pytest.raises(RuntimeError, match="not valid"):
        node.create_client(string, "chatter")
    with pytest.raises(RuntimeError, match="one argument"):
        node.create_subscription(string, "chatter", lambda: None, 1)
    with pytest.raises(UnsupportedError, match="content filter"):
        node.create_subscription(string, "chatter", print, 1, content_filter_options=object())
    with pytest.raises(AttributeError):
        node.handle = "garbage"  # type: ignore[assignment,misc]


def test_a_message_goes_from_publisher_to_subscription(node: Node) -> None:
    string = interface(STRING)
    publisher = node.create_publisher(string, "talk", 10)
    subscription = node.create_subscription(string, "talk", print, 10)
    assert (publisher.get_subscription_count(), subscription.get_publisher_count()) == (1, 1)
    assert (publisher.topic, publisher.topic_name, publisher.logger_name) == ("talk", "/lab/talk", "lab.probe")
    assert (subscription.topic_name, subscription.logger_name) == ("/lab/talk", "lab.probe")
    assert (node.count_publishers("talk"), node.count_subscribers("talk")) == (1, 1)

    class Derived(string):  # type: ignore[misc,valid-type]
        pass

    for message in (string(data="one"), string(data="two"), Derived(data="three")):
        publisher.publish(message)
    publisher.publish(b"\x00\x01\x00\x00\x05\x00\x00\x00four\x00")
    for wrong in (5, "text", interface("std_msgs/msg/Int32")()):
        with pytest.raises(TypeError, match="Expected"):
            publisher.publish(wrong)
    found: list[Any] = []

    def take() -> bool:
        with subscription.handle as handle:
            taken = handle.take_message(string, len(found) == 1)
        if taken is not None:
            found.append(taken)
        return len(found) == 4

    wait_until(take)
    assert [message if isinstance(message, bytes) else message.data for message, _ in found] == [
        "one",
        b"\x00\x01\x00\x00\x04\x00\x00\x00two\x00",
        "three",
        "four",
    ]
    infos = [info for _, info in found]
    assert [info["publication_sequence_number"] for info in infos] == [1, 2, 3, 4]
    assert all(0 < info["source_timestamp"] <= info["received_timestamp"] for info in infos)
    assert publisher.wait_for_all_acked()
    assert not subscription.is_cft_enabled
    with pytest.raises(UnsupportedError):
        subscription.set_content_filter("data = 1", [])


def test_a_publishers_subclass_may_have_its_own_publish(node: Node) -> None:
    from metaros.ros2.rclpy.core.publisher import Publisher

    sent = []

    class Noted(Publisher):
        def publish(self, msg: Any) -> None:
            sent.append(msg.data)
            super().publish(msg)

    publisher = node.create_publisher(interface(STRING), "noted", 1, publisher_class=Noted)
    subscription = node.create_subscription(interface(STRING), "noted", print, 1)
    publisher.publish(interface(STRING)(data="x"))
    wait_until(lambda: subscription.handle.take_message(interface(STRING), False) is not None)
    assert sent == ["x"]


def test_what_is_destroyed_is_gone_once(node: Node) -> None:
    string, add = interface(STRING), interface(ADD)
    made: dict[str, Any] = {
        "publisher": node.create_publisher(string, "one", 1),
        "subscription": node.create_subscription(string, "one", print, 1),
        "client": node.create_client(add, "add"),
        "service": node.create_service(add, "add", lambda a, b: b),
        "timer": node.create_timer(1.0, None),
        "guard_condition": node.create_guard_condition(None),
    }
    listed = [node.publishers, node.subscriptions, node.clients, node.services, node.timers, node.guards]
    for entity, entities in zip(made.values(), listed, strict=True):
        assert entity in list(entities)
    for kind, entity in made.items():
        with entity.handle:
            pass
        destroy = getattr(node, f"destroy_{kind}")
        assert destroy(entity), kind
        with pytest.raises(InvalidHandle), entity.handle:
            pass
        assert not destroy(entity), kind
    assert made["publisher"] not in list(node.publishers)
    assert not list(node.timers)
    calls: list[Any] = [
        lambda: made["publisher"].publish(string()),
        made["publisher"].get_subscription_count,
        lambda: made["client"].call_async(add.Request()),
        lambda: made["subscription"].topic_name,
    ]
    for call in calls:
        with pytest.raises(InvalidHandle):
            call()
    with node.create_publisher(string, "two", 1) as publisher:
        assert publisher.topic_name == "/lab/two"
    with pytest.raises(InvalidHandle):
        publisher.topic_name  # noqa: B018


def test_a_node_is_destroyed_once_or_with_its_context(rclpy_context: Context, own_context: Context) -> None:
    node = create_node("gone", context=rclpy_context)
    publisher = node.create_publisher(interface(STRING), "one", 1)
    with node.handle:
        node.destroy_node()
        assert node.get_name() == "gone"  # somebody holds it
    with pytest.raises(InvalidHandle), node.handle:
        pass
    with pytest.raises(InvalidHandle):
        node.destroy_node()
    with pytest.raises(InvalidHandle):
        publisher.publish(interface(STRING)())
    assert not list(node.publishers)

    own_context.init(args=[])
    node = create_node("gone_too", context=own_context)
    publisher = node.create_publisher(interface(STRING), "one", 1)
    own_context.shutdown()
    with pytest.raises(RCLError, match="context is not valid"):
        publisher.publish(interface(STRING)())
    node.destroy_node()
    with pytest.raises(InvalidHandle):
        node.destroy_node()


def test_a_node_that_cannot_be_made_leaves_the_graph(rclpy_context: Context) -> None:
    with pytest.raises(TypeError):
        create_node("half_made", context=rclpy_context, rosout_qos_profile="foo")
    with create_node("whole", context=rclpy_context) as node:
        assert "half_made" not in node.get_node_names()


def test_rosout_can_be_left_away(rclpy_context: Context) -> None:
    with create_node("silent", context=rclpy_context, enable_rosout=False) as node:
        topics = [name for name, _ in node.get_publisher_names_and_types_by_node("silent", "/")]
        assert topics == ["/parameter_events"]
    with create_node("loud", context=rclpy_context) as node:
        topics = [name for name, _ in node.get_publisher_names_and_types_by_node("loud", "/")]
        assert topics == ["/parameter_events", "/rosout"]


def test_a_node_offers_what_every_node_does(rclpy_context: Context) -> None:
    with create_node("usual", context=rclpy_context) as node:
        services = [name for name, _ in node.get_service_names_and_types_by_node("usual", "/")]
        assert services == [
            f"/usual/{name}"
            for name in (
                "describe_parameters",
                "get_parameter_types",
                "get_parameters",
                "get_type_description",
                "list_parameters",
                "set_parameters",
                "set_parameters_atomically",
            )
        ]
    with create_node("bare", context=rclpy_context, start_parameter_services=False) as node:
        services = [name for name, _ in node.get_service_names_and_types_by_node("bare", "/")]
        assert services == ["/bare/get_type_description"]


class _Executor:
    """What a node asks of an executor."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def add_node(self, node: Node) -> bool:
        self.calls.append("add")
        return True

    def remove_node(self, node: Node) -> None:
        self.calls.append("remove")

    def wake(self) -> None:
        self.calls.append("wake")


def test_a_node_has_one_executor(node: Node) -> None:
    assert node.executor is None
    first, second = _Executor(), _Executor()
    node.executor = first
    node.executor = first
    assert node.executor is first
    node.create_timer(1.0, None)
    assert first.calls == ["add", "wake"]
    node.executor = second
    assert (first.calls, second.calls) == (["add", "wake", "remove"], ["add"])
    node.executor = None
    assert node.executor is None
    assert second.calls == ["add", "remove"]


def test_waiting_for_nodes_and_messages(rclpy_context: Context, node: Node) -> None:
    assert not node.wait_for_node("/later", 0.0)
    string = interface(STRING)
    with create_node("later", context=rclpy_context) as other:
        assert node.wait_for_node("later", 30.0)
        publisher = other.create_publisher(string, "/once", 1)
        done = threading.Event()

        def publish() -> None:
            wait_until(lambda: publisher.get_subscription_count() == 1)
            while not done.wait(0.01):
                publisher.publish(string(data="now"))

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            found, message = wait_for_message(string, node, "/once", time_to_wait=30)
        finally:
            done.set()
            thread.join()
        assert found
        assert message.data == "now"
        assert wait_for_message(string, node, "/never", time_to_wait=0.01) == (False, None)
        assert wait_for_message(string, node, "/never", 0.01) == (False, None)  # as programs for Humble say it
        assert publisher.get_subscription_count() == 0


def test_a_wait_for_a_message_ends_with_the_context(own_context: Context) -> None:
    own_context.init(args=[])
    node = create_node("waits", context=own_context)

    def shut_down() -> None:
        wait_until(lambda: node.count_subscribers("/never"))
        own_context.shutdown()

    thread = threading.Thread(target=shut_down)
    thread.start()
    assert wait_for_message(interface(STRING), node, "/never") == (False, None)
    thread.join()


def test_a_node_that_nobody_has_leaves_the_graph(rclpy_context: Context, node: Node) -> None:
    forgotten = create_node("forgotten", context=rclpy_context)
    publisher = create_node("lent", context=rclpy_context).create_publisher(interface(STRING), "lent", 1)
    assert {"forgotten", "lent"} <= set(node.get_node_names())
    del forgotten
    wait_until(lambda: "forgotten" not in node.get_node_names())
    publisher.publish(interface(STRING)())
    assert "lent" in node.get_node_names()
