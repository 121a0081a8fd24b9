"""Profiles that parameters override."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.subscription import Subscription
from metaros.ros2.rclpy.qos import qos_overriding_options
from metaros.ros2.rclpy.qos.policies import QoSPolicyKind, ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_unknown
from metaros.ros2.rclpy.qos.qos_overriding_options import (
    InvalidQosOverridesError,
    QoSOverridingOptions,
    declare_qos_parameters,
)
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface

DEFAULT = QoSOverridingOptions.with_default_policies()


@pytest.fixture(name="node")
def _node(rclpy_context: Context) -> Iterator[Node]:
    arguments = [
        *("-p", "qos_overrides./t.publisher.depth:=100"),
        *("-p", "qos_overrides./t.publisher.reliability:=best_effort"),
        *("-p", "qos_overrides./t.publisher.deadline:=5000000"),
        *("-p", "qos_overrides./wrong.publisher.history:=all_of_it"),
    ]
    with Node("overridden", context=rclpy_context, cli_args=arguments) as node:
        yield node


def overrides(node: Node) -> dict[str, Any]:
    """The parameters that were declared."""
    return {name: parameter.value for name, parameter in node.get_parameters_by_prefix("qos_overrides").items()}


def test_parameters_are_declared_and_obeyed(node: Node) -> None:
    qos = QoSProfile(depth=10)
    for _ in range(2):  # the second time they are there
        declare_qos_parameters(Publisher, node, "/t", qos, DEFAULT)
    assert overrides(node) == {
        "/t.publisher.depth": 100,
        "/t.publisher.history": "keep_last",
        "/t.publisher.reliability": "best_effort",
    }
    assert (qos.depth, qos.reliability) == (100, ReliabilityPolicy.BEST_EFFORT)
    assert node.describe_parameter("qos_overrides./t.publisher.depth").read_only


def test_every_policy_can_be_overridden(node: Node) -> None:
    qos = QoSProfile(depth=10)
    kinds = [kind for kind in QoSPolicyKind if kind is not QoSPolicyKind.INVALID]
    declare_qos_parameters(Publisher, node, "/t", qos, QoSOverridingOptions(kinds, entity_id="a"))
    declare_qos_parameters(Publisher, node, "/t", qos, QoSOverridingOptions([QoSPolicyKind.DEADLINE]))
    declare_qos_parameters(Subscription, node, "/t", QoSProfile(depth=10), QoSOverridingOptions(kinds))
    found = overrides(node)
    assert len([name for name in found if ".publisher_a." in name]) == 9
    assert len([name for name in found if ".subscription." in name]) == 8  # no lifespan
    assert qos.deadline == Duration(nanoseconds=5000000)
    assert found["/t.publisher_a.liveliness"] == "system_default"
    assert found["/t.publisher_a.lifespan"] == 0


def test_a_callback_may_refuse(node: Node) -> None:
    result = qos_overriding_options.QosCallbackResult()
    seen: list[QoSProfile] = []

    def check(qos: QoSProfile) -> Any:
        seen.append(qos)
        return result

    options = QoSOverridingOptions.with_default_policies(callback=check)
    result.successful, result.reason = False, "too deep"
    with pytest.raises(InvalidQosOverridesError, match=r"publisher `/t` .*too deep"):
        declare_qos_parameters(Publisher, node, "/t", QoSProfile(depth=10), options)
    result.successful = True
    declare_qos_parameters(Publisher, node, "/t", QoSProfile(depth=10), options)
    assert [qos.depth for qos in seen] == [100, 100]


def test_what_is_wrong_is_said(node: Node) -> None:
    with pytest.raises(RuntimeError, match=r"history`: `all_of_it`; there are system_default, keep_last"):
        declare_qos_parameters(Publisher, node, "/wrong", QoSProfile(depth=10), DEFAULT)
    with pytest.raises(ValueError, match="unknown history"):
        declare_qos_parameters(Publisher, node, "/unknown", qos_profile_unknown, DEFAULT)
    with pytest.raises(TypeError):
        declare_qos_parameters(Node, node, "/t", QoSProfile(depth=10), DEFAULT)  # type: ignore[arg-type]


def test_publishers_take_the_options(node: Node) -> None:
    text = interface("std_msgs/msg/String")
    node.create_publisher(text, "t", 10, qos_overriding_options=DEFAULT)
    node.create_subscription(text, "t", lambda _: None, 10, qos_overriding_options=DEFAULT)
    (info,) = node.get_publishers_info_by_topic("t")
    assert (info.qos_profile.depth, info.qos_profile.reliability) == (100, ReliabilityPolicy.BEST_EFFORT)
    assert overrides(node)["/t.subscription.depth"] == 10
