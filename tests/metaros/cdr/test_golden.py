"""Bytes of real ROS 2 nodes and of Fast CDR, and rosbags as a second opinion on the values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from metaros.cdr import codec
from metaros.cdr.decoder import build_fast_decoder, build_general_decoder
from metaros.cdr.encoder import build_encoder
from metaros.idl import default_catalogue
from tests.support.tables import cases

VECTORS = json.loads((Path(__file__).parents[2] / "data" / "ros2_vectors.json").read_text())
REAL: dict[str, list[str]] = VECTORS["real_ros2_jazzy_cdr"]["vectors"]
ROSBAGS = get_typestore(Stores.ROS2_JAZZY)
LARGE_TYPES = [
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/PointCloud2",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "tf2_msgs/msg/TFMessage",
    "trajectory_msgs/msg/JointTrajectory",
    "visualization_msgs/msg/Marker",
    "diagnostic_msgs/msg/DiagnosticArray",
]


def never(_: Any) -> Any:
    raise AssertionError("good input was handed to the slow codec")


def dds_to_name(dds: str) -> str:
    package, kind, _, name = dds.split("::")
    return f"{package}/{kind}/{name.removesuffix('_')}"


def wire_cases() -> list[tuple[str, str]]:
    """(type, payload) of the captured data keys; service keys carry requests or responses of that service."""
    cases = [(vector["type"], vector["fastcdr_1_0_26"]) for vector in VECTORS["cdr"]]
    for sample in [*VECTORS["wire_reference"], *VECTORS["sdk_capture"]["samples"]]:
        name = dds_to_name(sample["key"].split("/")[-2])
        cases.append((name if "/msg/" in name else f"{name}_Request", sample["payload"]))
    server = VECTORS["sdk_service_server_reply"]
    add = "example_interfaces/srv/AddTwoInts"
    cases += [(f"{add}_Request", server["request_payload"]), (f"{add}_Response", server["payload"])]
    for query in VECTORS["sdk_capture"]["queries"]:
        name = dds_to_name(query["key"].split("/")[-2])
        cases += [(f"{name}_Request", query["payload"]), (f"{name}_Response", query["reply_payload"])]
    return cases


@cases("name", REAL)
def test_real_nodes_bytes_survive(name: str) -> None:
    encode = build_encoder(name, default_catalogue(), never)
    fast = build_fast_decoder(name, default_catalogue(), never)
    general = build_general_decoder(name, default_catalogue(), order="<", errors="strict")
    for text in REAL[name]:
        data = bytes.fromhex(text)
        message = fast(data)
        assert encode(message) == data
        assert general(memoryview(data)[4:]) == message
        assert codec(name).encode(codec(name).decode(data)) == data


def test_how_many_vectors_there_are() -> None:
    count = sum(len(vectors) for vectors in REAL.values())
    print(f"{count} vectors of {len(REAL)} types from real ROS 2 nodes, {len(wire_cases())} of Fast CDR and the wire")
    assert (len(REAL), count) == (93, 279)


@cases(("name", "payload"), wire_cases())
def test_wire_and_fast_cdr_vectors_survive(name: str, payload: str) -> None:
    data = bytes.fromhex(payload)
    assert codec(name).encode(codec(name).decode(data)) == data


@cases("name", sorted(REAL.keys() & ROSBAGS.fielddefs.keys()))
def test_rosbags_reads_the_same_values(name: str) -> None:
    for text in REAL[name]:
        data = bytes.fromhex(text)
        same(codec(name).decode(data), ROSBAGS.deserialize_cdr(data, name))


@cases("name", LARGE_TYPES)
@cases("frame", ["", "a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg"])
def test_rosbags_agrees_at_every_alignment(name: str, frame: str) -> None:
    compiled = codec(name)
    message = filled(compiled.decode(compiled.encode(default(name))), frame, 3)
    data = build_encoder(name, default_catalogue(), never)(message)
    theirs = ROSBAGS.deserialize_cdr(data, name)
    assert bytes(ROSBAGS.serialize_cdr(theirs, name)) == data
    same(build_fast_decoder(name, default_catalogue(), never)(data), theirs)
    assert compiled.decode(data) == message


def default(name: str) -> Any:
    from metaros.idl import message_class

    return message_class(name)()


def filled(message: Any, text: str, count: int) -> Any:
    """`message` with `text` in each string, sequences of `count` elements and numbers that differ."""
    number = 1
    for field in type(message).__metaros_fields__:
        kind, name = field.type, field.attribute
        number += 1
        if kind.is_nested and kind.is_sequence:
            setattr(
                message, name, [filled(default(kind.base), text * (i % 2), count - 1) for i in range(max(count, 0))]
            )
        elif kind.is_nested and not kind.array:
            filled(getattr(message, name), text, count)
        elif kind.is_string:
            setattr(message, name, [text, text + "x"] if kind.array else text)
        elif kind.array:
            size = kind.capacity or count
            setattr(message, name, np.arange(number, number + size).astype(getattr(message, name).dtype))
        elif kind.base != "bool":
            setattr(message, name, number)
    return message


def same(ours: Any, theirs: Any) -> None:
    for field in type(ours).__metaros_fields__:
        left, right = getattr(ours, field.attribute), getattr(theirs, field.name)
        if field.type.is_nested and field.type.array:
            assert len(left) == len(right)
            for one, other in zip(left, right, strict=True):
                same(one, other)
        elif field.type.is_nested:
            same(left, right)
        elif field.type.base == "byte":  # rosbags takes the octets of ROS 2 as signed
            np.testing.assert_array_equal(np.asarray(left), np.asarray(right).astype(np.int64) % 256)
        elif isinstance(left, np.ndarray):
            np.testing.assert_array_equal(left, np.asarray(right))
        else:
            assert left == right or (left != left and right != right)
