"""Messages as JSON-able values."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from metaros.errors import FieldError
from metaros.idl import Catalogue, default_catalogue, message_class, parse_msg
from metaros.idl.json import from_dict, from_json, to_json
from tests.support.tables import cases


def test_every_shipped_message_survives() -> None:
    for name in default_catalogue().names("msg"):
        message = message_class(name)()
        text = json.dumps(to_json(message), allow_nan=False)
        assert from_json(name, json.loads(text)) == message


def test_numbers_that_json_lacks() -> None:
    cls = message_class("sensor_msgs/msg/LaserScan")
    scan = cls(range_max=math.inf, angle_min=math.nan, ranges=[1.0, math.inf, math.nan])
    value = to_json(scan)
    assert (value["range_max"], value["angle_min"], value["ranges"]) == (None, None, [1.0, None, None])
    back = from_json(cls, value)
    assert math.isnan(back.range_max)
    assert np.isnan(back.ranges[1:]).all()


def test_long_bytes_are_counted() -> None:
    cls = message_class("sensor_msgs/msg/Image")
    assert to_json(cls(data=bytes(64)))["data"] == [0] * 64
    assert to_json(cls(data=bytes(65)))["data"] == {"bytes": 65}


def test_numpy_scalars_become_plain() -> None:
    value = to_json(message_class("geometry_msgs/msg/Point")(x=np.float64(1.5), y=np.int32(2)))
    assert json.dumps(value) == '{"x": 1.5, "y": 2.0, "z": 0.0}'


def test_partial_dicts_get_defaults() -> None:
    pose = from_dict("geometry_msgs/msg/PoseStamped", {"pose": {"position": {"x": 2}}})
    assert (pose.pose.position.x, pose.pose.orientation.w, pose.header.frame_id) == (2.0, 1.0, "")


@cases(
    ("name", "value", "complaint"),
    [
        ("geometry_msgs/msg/PoseStamped", {"pose": {"position": {"q": 2}}}, r"pose\.position\.q: .* has no such field"),
        ("geometry_msgs/msg/PoseStamped", {"pose": 3}, "pose: expected an object, got the number 3"),
        ("geometry_msgs/msg/Point", [], "the message: expected an object, got a list"),
        ("geometry_msgs/msg/Point", {"x": "1"}, "x: expected a float64, got a text"),
        ("geometry_msgs/msg/Point", {"x": True}, "x: expected a float64"),
        ("geometry_msgs/msg/Point", {"x": 10**400}, "does not fit float64"),
        ("std_msgs/msg/Float32", {"data": 1e39}, "does not fit float32"),
        ("std_msgs/msg/UInt8", {"data": 256}, "data: 256 does not fit uint8"),
        ("std_msgs/msg/UInt8", {"data": 1.5}, "whole number"),
        ("std_msgs/msg/UInt8", {"data": True}, "whole number"),
        ("std_msgs/msg/Bool", {"data": 1}, "expected a bool"),
        ("std_msgs/msg/String", {"data": None}, "data: expected a text, got null"),
        ("sensor_msgs/msg/Image", {"data": [1, 256]}, r"data\[1\]: 256 does not fit"),
        ("sensor_msgs/msg/Image", {"data": "AAA="}, "data: expected a list"),
        ("sensor_msgs/msg/Imu", {"orientation_covariance": [1]}, "exactly 9"),
        (
            "tf2_msgs/msg/TFMessage",
            {"transforms": [{}, {"header": {"stamp": {"sec": 2**31}}}]},
            r"transforms\[1\]\.header",
        ),
    ],
)
def test_complaints_name_the_path(name: str, value: Any, complaint: str) -> None:
    with pytest.raises(FieldError, match=complaint):
        from_json(name, value)


def test_bounds() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("string<=3[<=2] a", "p/msg/N"))
    assert from_json("p/msg/N", {"a": ["abc"]}, catalogue).a == ["abc"]
    with pytest.raises(FieldError, match=r"a\[0\]: 4 characters"):
        from_json("p/msg/N", {"a": ["abcd"]}, catalogue)
    with pytest.raises(FieldError, match="at most 2"):
        from_json("p/msg/N", {"a": ["", "", ""]}, catalogue)


def test_whole_floats_are_whole_numbers() -> None:
    assert from_json("std_msgs/msg/UInt8", {"data": 3.0}).data == 3


def test_a_service_is_no_message() -> None:
    with pytest.raises(FieldError, match="no message type"):
        from_json("std_srvs/srv/Trigger", {})
