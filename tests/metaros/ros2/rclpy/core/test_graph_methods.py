"""What a node sees of the graph: itself, and a peer in another session."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import metaros
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.endpoint_info import EndpointTypeEnum, TopicEndpointTypeEnum
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.rcl_errors import NodeNameNonExistentError
from metaros.ros2.rclpy.names.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
)
from metaros.ros2.rclpy.qos.policies import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until

TEXT, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


@pytest.fixture(scope="module", name="node")
def _node(rclpy_context: Context, ros2_router: str) -> Iterator[Node]:
    """A node that has one endpoint of each kind, and sees a peer that has them, too."""
    text, trigger = interface(TEXT), interface(TRIGGER)
    arguments = ["-r", "old:=/new", "-e", "/lab"]
    with Node("eye", namespace="/ns", context=rclpy_context, cli_args=arguments) as node:
        node.create_publisher(text, "seen", 1)
        node.create_subscription(text, "seen", lambda _: None, 1)
        node.create_subscription(text, "/new", lambda _: None, 1)
        node.create_client(trigger, "~/kick")
        node.create_client(trigger, "nobody_serves")
        node.create_service(trigger, "~/kick", lambda _, response: response)
        router = f"tcp/127.0.0.1:{ros2_router}"
        with (
            metaros.Context(domain_id=0, connect=router, environ={}) as context,
            metaros.Node("peer", context=context) as peer,
        ):
            peer.create_publisher(str, "/theirs")
            peer.create_publisher(str, "/ns/seen")
            wait_until(lambda: node.count_publishers("seen") == 2)
            yield node


def test_names_of_nodes(node: Node) -> None:
    assert {("eye", "/ns"), ("peer", "/")} <= set(node.get_node_names_and_namespaces())
    assert ("eye", "/ns", "/lab") in node.get_node_names_and_namespaces_with_enclaves()
    assert {"eye", "peer"} <= set(node.get_node_names())
    assert {"/ns/eye", "/peer"} <= set(node.get_fully_qualified_node_names())


def test_names_and_types(node: Node) -> None:
    topics, services = dict(node.get_topic_names_and_types()), dict(node.get_service_names_and_types())
    assert (topics["/ns/seen"], topics["/new"], services["/ns/eye/kick"]) == ([TEXT], [TEXT], [TRIGGER])
    assert services["/ns/nobody_serves"] == [TRIGGER]
    assert "/ns/eye/kick" not in topics
    assert list(topics) == sorted(topics)


def test_what_a_node_has(node: Node) -> None:
    found = {
        "publishers": dict(node.get_publisher_names_and_types_by_node("eye", "/ns")),
        "subscriptions": dict(node.get_subscriber_names_and_types_by_node("eye", "/ns")),
        "services": dict(node.get_service_names_and_types_by_node("eye", "/ns")),
        "clients": dict(node.get_client_names_and_types_by_node("eye", "/ns")),
    }
    assert set(found["publishers"]) >= {"/ns/seen", "/rosout"}
    assert "/theirs" not in found["publishers"]
    assert "/theirs" in dict(node.get_publisher_names_and_types_by_node("peer", "/"))
    assert found["subscriptions"] == {"/new": [TEXT], "/ns/seen": [TEXT]}
    assert found["services"].keys() >= {"/ns/eye/kick", "/ns/eye/get_parameters", "/ns/eye/get_type_description"}
    assert found["clients"] == {"/ns/eye/kick": [TRIGGER], "/ns/nobody_serves": [TRIGGER]}
    assert "/ns/nobody_serves" not in found["services"]
    with pytest.raises(NodeNameNonExistentError, match="/ns/ear"):
        node.get_client_names_and_types_by_node("ear", "/ns")
    with pytest.raises(InvalidNodeNameException):
        node.get_client_names_and_types_by_node("ear?", "/ns")
    with pytest.raises(InvalidNamespaceException):
        node.get_client_names_and_types_by_node("ear", "ns")


def test_endpoints_are_counted_by_the_name_that_the_node_means(node: Node) -> None:
    assert [node.count_publishers(name) for name in ("seen", "/ns/seen", "/seen", "old")] == [2, 2, 0, 0]
    assert [node.count_subscribers(name) for name in ("seen", "old", "/new", "/ns/old")] == [1, 1, 1, 1]
    assert (node.count_clients("~/kick"), node.count_services("/ns/eye/kick")) == (1, 1)
    calls: list[Any] = [node.count_publishers, node.count_subscribers, node.get_publishers_info_by_topic]
    for call in calls:
        with pytest.raises(TypeError):
            call(1)
        with pytest.raises(ValueError, match="is invalid"):
            call("42")


def test_endpoints_of_a_topic(node: Node) -> None:
    mine, theirs = sorted(node.get_publishers_info_by_topic("seen"), key=lambda info: info.node_name)
    assert (mine.node_name, mine.node_namespace, mine.topic_type) == ("eye", "/ns", TEXT)
    assert (theirs.node_name, theirs.node_namespace, theirs.topic_type) == ("peer", "/", TEXT)
    assert mine.endpoint_type == TopicEndpointTypeEnum.PUBLISHER
    assert str(mine.topic_type_hash).startswith("RIHS01_df668c74")
    assert len(mine.endpoint_gid) == 16
    assert mine.endpoint_gid != theirs.endpoint_gid
    assert (mine.qos_profile.depth, str(mine.qos_profile.deadline)) == (1, "Infinite")
    assert [info.node_name for info in node.get_subscriptions_info_by_topic("old")] == ["eye"]
    assert node.get_subscriptions_info_by_topic("old", no_mangle=True) == []
    assert len(node.get_subscriptions_info_by_topic("/new", no_mangle=True)) == 1


def test_profiles_of_a_topic_are_as_they_were_given(node: Node) -> None:
    qos = QoSProfile(
        depth=3,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        deadline=Duration(seconds=1, nanoseconds=12345),
        lifespan=Duration(seconds=20, nanoseconds=9887665),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=5, nanoseconds=23456),
    )
    publisher = node.create_publisher(interface(TEXT), "kept", qos)
    assert [info.qos_profile for info in node.get_publishers_info_by_topic("kept")] == [qos]
    node.destroy_publisher(publisher)
    assert node.get_publishers_info_by_topic("kept") == []


def test_endpoints_of_a_service(node: Node) -> None:
    (client,), (server,) = node.get_clients_info_by_service("~/kick"), node.get_servers_info_by_service("~/kick")
    assert (client.endpoint_type, server.endpoint_type) == (EndpointTypeEnum.CLIENT, EndpointTypeEnum.SERVER)
    assert (client.service_type, client.node_name, client.endpoint_count) == (TRIGGER, "eye", 1)
    assert len(server.endpoint_gids) == len(server.qos_profiles) == 1


def test_names_are_resolved(node: Node) -> None:
    assert node.resolve_topic_name("old") == "/new"
    assert node.resolve_topic_name("old", only_expand=True) == "/ns/old"
    assert node.resolve_topic_name("{node}/a") == "/ns/eye/a"
    assert node.resolve_service_name("~/kick") == "/ns/eye/kick"
    with pytest.raises(InvalidTopicNameException):
        node.resolve_topic_name("a?")
    with pytest.raises(InvalidServiceNameException):
        node.resolve_service_name("a?")
    with pytest.raises(ValueError, match="unknown substitution"):
        node.resolve_topic_name("{x}")
