"""Types guessed from what was said, and the user's own table."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.broker import TypeTable
from metaros.broker.type_inference import infer_type, known_type
from metaros.errors import ConfigError
from metaros.idl import default_catalogue


@pytest.mark.parametrize(
    ("value", "name"),
    [
        ({"data": "a"}, "std_msgs/msg/String"),
        ({"data": True}, "std_msgs/msg/Bool"),
        ({"data": 3}, "std_msgs/msg/Int64"),
        ({"data": 1 << 70}, "std_msgs/msg/Float64"),
        ({"data": 2.5}, "std_msgs/msg/Float64"),
        (21.5, "std_msgs/msg/Float64"),
        ("text", "std_msgs/msg/String"),
        (b"\xff", "metaros_msgs/msg/Bytes"),
        ([1, 2], "metaros_msgs/msg/Json"),
        (None, "metaros_msgs/msg/Json"),
        ({"data": [1, 2]}, "metaros_msgs/msg/Json"),
        ({"x": 0, "y": 0, "z": 0}, "geometry_msgs/msg/Vector3"),
        ({"linear": {}, "angular": {}}, "geometry_msgs/msg/Twist"),
        ({"header": {}, "child_frame_id": "", "pose": {}, "twist": {}}, "nav_msgs/msg/Odometry"),
        ({"seq": 0, "stamp": 0.0, "frame_id": ""}, "std_msgs/msg/Header"),
        ({"_type": "sensor_msgs/BatteryState", "voltage": 12.0}, "sensor_msgs/msg/BatteryState"),
        ({"_type": "no_such/Type", "data": 1}, "metaros_msgs/msg/Json"),
        ({"anything": "else"}, "metaros_msgs/msg/Json"),
        ({}, "metaros_msgs/msg/Json"),
    ],
)
def test_guess(value: Any, name: str) -> None:
    assert infer_type(value) == name
    assert name in default_catalogue()


def test_known_types() -> None:
    assert known_type("std_msgs/String") == known_type("std_msgs/msg/String") == "std_msgs/msg/String"
    for name in ("String", "std_srvs/srv/Trigger", "std_msgs/msg/Nonsense", "a/b/c/d", ""):
        assert known_type(name) is None


def test_the_first_rule_that_fits_holds() -> None:
    table = TypeTable.parse(["/arm/*=std_msgs/Float64", "**=std_msgs/msg/String"])
    assert table.type_of("/arm/joint") == "std_msgs/msg/Float64"
    assert table.type_of("/arm/left/joint") == "std_msgs/msg/String"
    assert TypeTable().type_of("/arm/joint") is None


@pytest.mark.parametrize("text", ["/chatter", "/chatter=", "/chatter=std_msgs/Nonsense", "/a b=std_msgs/String"])
def test_bad_rules_are_named(text: str) -> None:
    with pytest.raises(ConfigError, match="--map"):
        TypeTable.parse([text])
