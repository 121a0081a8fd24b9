"""Infos of endpoints: made, set, compared and shown as rclpy's."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.ros2.rclpy.core.endpoint_info import (
    EndpointTypeEnum,
    ServiceEndpointInfo,
    TopicEndpointInfo,
    TopicEndpointTypeEnum,
)
from metaros.ros2.rclpy.names.type_hash import TypeHash
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_default, qos_profile_sensor_data

TOPIC: dict[str, Any] = {
    "node_name": "n",
    "node_namespace": "/ns",
    "topic_type": "a/msg/B",
    "topic_type_hash": TypeHash(1, bytes(range(32))),
    "endpoint_type": TopicEndpointTypeEnum.SUBSCRIPTION,
    "endpoint_gid": [0, 255, 16],
    "qos_profile": qos_profile_default,
}
SERVICE: dict[str, Any] = {
    "node_name": "n",
    "node_namespace": "/ns",
    "service_type": "a/srv/B",
    "service_type_hash": TypeHash(1, bytes(range(32))),
    "qos_profiles": [qos_profile_default],
    "endpoint_gids": [[1, 2]],
    "endpoint_type": EndpointTypeEnum.SERVER,
    "endpoint_count": 1,
}


def test_each_field_is_given_or_set() -> None:
    kinds: list[tuple[type[Any], dict[str, Any]]] = [(TopicEndpointInfo, TOPIC), (ServiceEndpointInfo, SERVICE)]
    for kind, fields in kinds:
        assert kind() == kind()
        for name, value in fields.items():
            given, info = kind(**{name: value}), kind()
            assert info != given, name
            setattr(info, name, value)
            assert (info, getattr(info, name)) == (given, value), name
    assert TopicEndpointInfo() != ServiceEndpointInfo()


def test_values_of_other_types_are_refused() -> None:
    for kind, fields in ((TopicEndpointInfo, TOPIC), (ServiceEndpointInfo, SERVICE)):
        for name in fields:
            with pytest.raises((AssertionError, TypeError)):
                setattr(kind(), name, 1.5)


def test_dictionaries_stand_for_hashes_and_profiles() -> None:
    info = TopicEndpointInfo(topic_type_hash={"version": 1, "value": bytes(32)}, qos_profile={"depth": 7})
    assert (info.topic_type_hash, info.qos_profile) == (TypeHash(1, bytes(32)), QoSProfile(depth=7))
    assert ServiceEndpointInfo(qos_profiles=[{"depth": 7}]).qos_profiles == [QoSProfile(depth=7)]


def test_they_are_shown_line_by_line() -> None:
    assert str(TopicEndpointInfo()).splitlines() == [
        "Node name: ",
        "Node namespace: ",
        "Topic type: ",
        "Topic type hash: INVALID",
        "Endpoint type: INVALID",
        "GID: ",
        "QoS profile:",
        "  Reliability: UNKNOWN",
        "  History (Depth): UNKNOWN",
        "  Durability: UNKNOWN",
        "  Lifespan: 0 nanoseconds",
        "  Deadline: 0 nanoseconds",
        "  Liveliness: UNKNOWN",
        "  Liveliness lease duration: 0 nanoseconds",
    ]
    shown = str(TopicEndpointInfo(**TOPIC | {"qos_profile": qos_profile_sensor_data}))
    assert "GID: 00.ff.10\n" in shown
    assert "  History (Depth): KEEP_LAST (5)\n" in shown
    assert "Endpoint type: SERVER\nEndpoint count: 1\nGID: 01.02\n" in str(ServiceEndpointInfo(**SERVICE))
