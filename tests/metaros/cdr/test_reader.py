"""Field readers on real types: paths, what they refuse, and how little they look at."""

from __future__ import annotations

import math

import pytest

from metaros.cdr import codec, field_reader
from metaros.errors import DecodeError, FieldError, UnknownTypeError
from metaros.idl import Catalogue, default_catalogue, message_class, parse_msg
from tests.support.tables import cases


def test_odometry() -> None:
    cls = message_class("nav_msgs/msg/Odometry")
    message = cls(child_frame_id="base")
    message.header.frame_id = "odom"
    message.header.stamp.sec = 7
    message.pose.pose.position.x = 1.5
    message.pose.covariance[35] = 0.25
    message.twist.twist.angular.z = -2.0
    paths = ["twist.twist.angular.z", "pose.pose.position.x", "pose.covariance[35]", "header.stamp.sec"]
    assert field_reader(cls, paths)(codec(cls).encode(message)) == (-2.0, 1.5, 0.25, 7.0)


def test_elements_of_sequences_of_messages() -> None:
    cls, stamped = message_class("tf2_msgs/msg/TFMessage"), message_class("geometry_msgs/msg/TransformStamped")
    message = cls(transforms=[stamped(child_frame_id="x" * i) for i in range(4)])
    for index, transform in enumerate(message.transforms):
        transform.transform.translation.x = float(index)
    paths = [f"transforms[{i}].transform.translation.x" for i in (2, 0, 9)]
    found = field_reader("tf2_msgs/msg/TFMessage", paths)(codec(cls).encode(message))
    assert found[:2] == (2.0, 0.0)
    assert math.isnan(found[2])


def test_the_same_path_twice_and_none() -> None:
    cls = message_class("std_msgs/msg/UInt8")
    data = codec(cls).encode(cls(data=3))
    assert field_reader(cls, ["data", "data"])(data) == (3.0, 3.0)
    assert field_reader(cls, [])(data) == ()
    assert all(isinstance(value, float) for value in field_reader(cls, ["data", "data"])(data))


def test_a_reader_is_made_once() -> None:
    assert field_reader("std_msgs/msg/UInt8", ["data"]) is field_reader("std_msgs/msg/UInt8", ("data",))


def test_what_is_behind_the_last_path_is_not_looked_at() -> None:
    cls = message_class("sensor_msgs/msg/BatteryState")
    data = codec(cls).encode(cls(percentage=0.5))
    assert field_reader(cls, ["percentage"])(data[:48]) == (0.5,)


def test_skipping_strides() -> None:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(
        parse_msg("geometry_msgs/Point32[] points\nuint8 a\ngeometry_msgs/Pose[] poses\nfloat64 b", "p/msg/N")
    )
    cls = message_class("p/msg/N", catalogue)
    points = [message_class("geometry_msgs/msg/Point32")() for _ in range(5)]
    for count in range(3):
        poses = [message_class("geometry_msgs/msg/Pose")() for _ in range(count)]
        data = codec(cls).encode(cls(points=points, a=9, poses=poses, b=2.5))
        assert field_reader(cls, ["a", "b"])(data) == (9.0, 2.5)


@cases(
    ("path", "complaint"),
    [
        ("x", "no field 'x'; its fields are: header"),
        ("", "is no field"),
        ("header", "not a number"),
        ("header.frame_id", "is a string, not a number"),
        ("cell_voltage", r"is a float32\[\], not a number"),
        ("percentage.x", "has no fields"),
        ("percentage[0]", "not an array"),
        ("cell_voltage[-1]", "is no field"),
        ("cell_voltage[0].x", "has no fields"),
        ("cell_voltage[99999999999]", "is no field"),
    ],
)
def test_paths_that_are_none(path: str, complaint: str) -> None:
    with pytest.raises(FieldError, match=complaint):
        field_reader("sensor_msgs/msg/BatteryState", [path])


def test_an_index_past_a_fixed_array() -> None:
    with pytest.raises(FieldError, match="at most 9 elements"):
        field_reader("sensor_msgs/msg/Imu", ["orientation_covariance[9]"])


def test_too_many_paths_and_unknown_types() -> None:
    with pytest.raises(FieldError, match="at most 1024"):
        field_reader("std_msgs/msg/UInt8", ["data"] * 1025)
    with pytest.raises(UnknownTypeError):
        field_reader("p/msg/Nope", ["a"])


@cases("data", [b"", b"\0\1\0\0", b"\0\7\0\0" + bytes(400), b"\0\1\0\0" + bytes(8) + b"\xff" * 40])
def test_malformed_bytes(data: bytes) -> None:
    with pytest.raises(DecodeError):
        field_reader("sensor_msgs/msg/Imu", ["linear_acceleration.x"])(data)
