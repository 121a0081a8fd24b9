"""Messages as YAML: what is printed reads back as the same values."""

from __future__ import annotations

import math
from typing import Any

import pytest
import yaml

from metaros.cli.shared.render import field_of, message_yaml, plain
from metaros.errors import FieldError
from metaros.idl import message_class
from tests.support.tables import cases


def make(name: str, **values: Any) -> Any:
    """A message of the catalogue."""
    return message_class(name)(**values)


def test_odometry_reads_back_as_its_values() -> None:
    message = make("nav_msgs/msg/Odometry", child_frame_id="base")
    message.pose.pose.position.x = 1.5
    value = yaml.safe_load(message_yaml(message, full=True))
    assert value["child_frame_id"] == "base"
    assert value["pose"]["pose"]["position"] == {"x": 1.5, "y": 0.0, "z": 0.0}
    assert value["pose"]["covariance"] == [0.0] * 36


def test_long_arrays_are_cut_and_say_so() -> None:
    message = make("sensor_msgs/msg/LaserScan", ranges=[1.0] * 100)
    assert "# and 84 more" in message_yaml(message)
    assert len(yaml.safe_load(message_yaml(message))["ranges"]) == 16
    assert len(yaml.safe_load(message_yaml(message, full=True))["ranges"]) == 100


def test_bytes_are_numbers() -> None:
    message = make("sensor_msgs/msg/CompressedImage", format="jpeg", data=b"\xff\xd8")
    assert yaml.safe_load(message_yaml(message))["data"] == [255, 216]


def test_lists_of_messages_are_items() -> None:
    transform = make("geometry_msgs/msg/TransformStamped", child_frame_id="base")
    message = make("tf2_msgs/msg/TFMessage", transforms=[transform, transform])
    value = yaml.safe_load(message_yaml(message))
    assert [item["child_frame_id"] for item in value["transforms"]] == ["base", "base"]
    assert value["transforms"][0]["transform"]["rotation"]["w"] == 1.0


def test_an_empty_list_and_an_empty_message() -> None:
    assert message_yaml(make("tf2_msgs/msg/TFMessage")) == "transforms: []"
    assert message_yaml(make("std_msgs/msg/Empty")) == ""


@cases("text", ["", "plain", "true", "1.5", "a: b", "# no", "two\nlines", "quote's", "ü", "null", "x" * 300])
def test_text_reads_back_as_text(text: str) -> None:
    assert yaml.safe_load(message_yaml(make("std_msgs/msg/String", data=text))) == {"data": text}


@cases("number", [0.0, -1.5, 1e300, 5e-324, math.inf, -math.inf])
def test_numbers_read_back(number: float) -> None:
    shown = message_yaml(make("std_msgs/msg/Float64", data=number)).removeprefix("data: ")
    assert float(shown.replace(".inf", "inf")) == number
    assert message_yaml(make("std_msgs/msg/Float64", data=math.nan)) == "data: .nan"
    assert message_yaml(make("std_msgs/msg/Bool", data=True)) == "data: true"


def test_a_field_by_its_path() -> None:
    message = make("nav_msgs/msg/Odometry")
    message.pose.pose.position.y = 2.5
    assert field_of(message, "pose.pose.position.y") == 2.5
    assert plain(field_of(message, "pose.pose.position")) == {"x": 0.0, "y": 2.5, "z": 0.0}
    scan = make("sensor_msgs/msg/LaserScan", ranges=[1.0, 2.0])
    assert field_of(scan, "ranges[1]") == 2.0
    assert plain(field_of(scan, "ranges")) == [1.0, 2.0]


@cases(
    ("path", "word"),
    [
        ("pose.pos", "pose, covariance"),
        ("child_frame_id.x", "no field"),
        ("pose.covariance[99]", "36 elements"),
        ("pose[0]", "not an array"),
    ],
)
def test_a_path_that_leads_nowhere_says_what_there_is(path: str, word: str) -> None:
    with pytest.raises(FieldError, match=word):
        field_of(make("nav_msgs/msg/Odometry"), path)
