"""The JSON of `metaros` 1.x and ROS 2 messages, there and back."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.broker.v1_json import from_payload, to_payload
from metaros.cdr import codec
from metaros.errors import FieldError
from metaros.idl import message_class

CLASSES = (
    "std_msgs/msg/String",
    "std_msgs/msg/Header",
    "std_msgs/msg/UInt8MultiArray",
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/JointState",
    "builtin_interfaces/msg/Duration",
)


def read(name: str, value: Any) -> tuple[Any, list[str]]:
    ignored: list[str] = []
    return from_payload(message_class(name), value, ignored=ignored.append), ignored


@pytest.mark.parametrize("name", CLASSES)
def test_what_is_written_can_be_read(name: str) -> None:
    cls = message_class(name)
    value = json.loads(to_payload(cls(), seq=5))
    message, ignored = read(name, value)
    assert message == cls()
    assert ignored == []


def test_a_header_is_that_of_ros_1() -> None:
    header = message_class("std_msgs/msg/Header")(frame_id="map")
    header.stamp.sec, header.stamp.nanosec = 10, 250_000_000
    assert json.loads(to_payload(header, seq=3)) == {"stamp": 10.25, "frame_id": "map", "seq": 3}
    for stamp in (10.25, {"sec": 10, "nanosec": 250_000_000}, {"secs": 10, "nsecs": 250_000_000}):
        assert read("std_msgs/msg/Header", {"seq": 1, "stamp": stamp, "frame_id": "map"}) == (header, [])
    assert read("std_msgs/msg/Header", {"stamp": None})[0].stamp.sec == 0


def test_the_scan_that_1_x_makes_by_default() -> None:
    """Every number None, no readings; ROS 2 has no angles."""
    value = {
        "header": {"seq": 0, "stamp": 1.0, "frame_id": ""},
        **dict.fromkeys(("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time")),
        **dict.fromkeys(("range_min", "range_max")),
        "ranges": [],
        "intensities": [],
        "angles": [],
    }
    scan, ignored = read("sensor_msgs/msg/LaserScan", value)
    assert math.isnan(scan.angle_min)
    assert (len(scan.ranges), ignored) == (0, [])


def test_numbers_that_are_not_finite() -> None:
    scan = message_class("sensor_msgs/msg/LaserScan")(ranges=[1.0, math.inf, math.nan], range_max=math.inf)
    assert b'"ranges":[1.0,Infinity,NaN]' in to_payload(scan)
    strict = json.loads(to_payload(scan, strict=True), parse_constant=pytest.fail)
    assert (strict["ranges"], strict["range_max"]) == ([1.0, None, None], None)
    back = read("sensor_msgs/msg/LaserScan", strict)[0]
    assert math.isnan(back.ranges[1])


def test_pictures_are_whole_in_any_shape() -> None:
    image = message_class("sensor_msgs/msg/Image")(width=100, height=2, step=100, data=list(range(200)))
    value = json.loads(to_payload(image))
    assert value["data"] == list(range(200))
    value["data"] = np.array(value["data"]).reshape(2, 100).tolist()
    assert read("sensor_msgs/msg/Image", value)[0] == image
    value["data"] = np.array(value["data"]).reshape(2, 50, 2).tolist()
    assert read("sensor_msgs/msg/Image", value)[0] == image
    value |= {"height": None, "width": None}
    assert read("sensor_msgs/msg/Image", value)[0].height == 0


def test_a_path_of_poses_with_covariance() -> None:
    pose = {"position": {"x": 1, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    path, ignored = read("nav_msgs/msg/Path", {"header": {}, "poses": [{"pose": pose, "covariance": []}]})
    assert (path.poses[0].pose.position.x, ignored) == (1.0, [])
    assert json.loads(to_payload(path))["poses"][0]["covariance"] == []


def test_a_value_alone_is_the_data() -> None:
    assert read("std_msgs/msg/Float64", 3)[0].data == 3.0
    assert bytes(read("std_msgs/msg/UInt8MultiArray", b"\x00\xff")[0].data) == b"\x00\xff"


def test_fields_that_are_not_there_are_reported() -> None:
    message, ignored = read("geometry_msgs/msg/Twist", {"linear": {"x": 1, "w": 0}, "gear": 2})
    assert (message.linear.x, ignored) == (1.0, ["linear.w", "gear"])


@pytest.mark.parametrize(
    ("name", "value", "where"),
    [
        ("geometry_msgs/msg/Twist", {"linear": {"x": "fast"}}, "linear.x"),
        ("geometry_msgs/msg/Twist", {"linear": 3}, "linear"),
        ("geometry_msgs/msg/Twist", {"speed": 3}, "nothing in it"),
        ("geometry_msgs/msg/Twist", 3, "nothing in it"),
        ("std_msgs/msg/Int8", {"data": 300}, "data"),
        ("std_msgs/msg/String", {"data": 3}, "data"),
        ("std_msgs/msg/Header", {"stamp": math.inf}, "stamp"),
        ("std_msgs/msg/Header", {"stamp": 1e300}, "stamp"),
        ("sensor_msgs/msg/LaserScan", {"ranges": ["a"]}, "ranges"),
        ("sensor_msgs/msg/LaserScan", {"ranges": 5}, "ranges"),
        ("sensor_msgs/msg/LaserScan", {"ranges": [[1.0], 2.0]}, "ranges"),
        ("sensor_msgs/msg/Image", {"data": [256]}, "data"),
        ("nav_msgs/msg/Path", {"poses": [{"pose": {"position": {"x": []}}}]}, "poses[0].pose.position.x"),
        ("nav_msgs/msg/Path", {"poses": 1}, "poses"),
        ("nav_msgs/msg/Odometry", {"pose": {"covariance": [1.0]}}, "pose.covariance"),
    ],
)
def test_what_does_not_fit_is_named(name: str, value: Any, where: str) -> None:
    with pytest.raises(FieldError) as caught:
        read(name, value)
    assert where in str(caught.value)


keys = st.sampled_from(
    ["header", "seq", "stamp", "frame_id", "pose", "position", "x", "poses", "data", "ranges", "covariance", "sec", "q"]
)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=6),
    max_leaves=12,
)


@settings(max_examples=50)
@given(st.sampled_from(CLASSES), json_values)
def test_any_json_is_taken_or_refused(name: str, value: Any) -> None:
    try:
        message, _ = read(name, value)
    except FieldError:
        return
    codec(type(message)).encode(message)
