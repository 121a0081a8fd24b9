"""`@message` classes that say the same as the definitions of ROS 2 have the hashes of the real rosidl generator."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

import metaros
from metaros.cdr import codec
from metaros.idl import Catalogue, FieldType, MessageDefinition, default_catalogue, message_class, schema_text
from metaros.idl.arrays import DTYPES
from tests.support.tables import cases

HASHES = json.loads((Path(__file__).parents[2] / "data" / "ros2_rihs01.json").read_text())["distros"]["jazzy"]["hashes"]
PRIVATE = Catalogue()


@metaros.message(name="builtin_interfaces/msg/Time", catalogue=PRIVATE)
class Time:
    """By hand, as a user would."""

    sec: metaros.int32
    nanosec: metaros.uint32


@metaros.message(name="std_msgs/msg/Header", catalogue=PRIVATE)
class Header:
    """By hand."""

    stamp: Time
    frame_id: str


@metaros.message(name="geometry_msgs/msg/Vector3", catalogue=PRIVATE)
class Vector3:
    """By hand."""

    x: float
    y: float
    z: float


@metaros.message(name="geometry_msgs/msg/Point", catalogue=PRIVATE)
class Point:
    """By hand."""

    x: float
    y: float
    z: float


@metaros.message(name="geometry_msgs/msg/Quaternion", catalogue=PRIVATE)
class Quaternion:
    """By hand."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@metaros.message(name="geometry_msgs/msg/Pose", catalogue=PRIVATE)
class Pose:
    """By hand."""

    position: Point
    orientation: Quaternion


@metaros.message(name="sensor_msgs/msg/Imu", catalogue=PRIVATE)
class Imu:
    """By hand."""

    header: Header
    orientation: Quaternion
    orientation_covariance: Annotated[NDArray[np.float64], metaros.Shape(3, 3)]
    angular_velocity: Vector3
    angular_velocity_covariance: Annotated[NDArray[np.float64], metaros.Shape(3, 3)]
    linear_acceleration: Vector3
    linear_acceleration_covariance: Annotated[list[float], metaros.Fixed(9)]


@cases("cls", [Time, Header, Vector3, Point, Quaternion, Pose, Imu])
def test_known_types_by_hand_have_the_hashes_of_rosidl(cls: Any) -> None:
    assert cls.__metaros_hash__ == HASHES[cls.__metaros_name__]
    assert codec(cls).hash == HASHES[cls.__metaros_name__]
    assert schema_text(cls.__metaros_name__, PRIVATE) == schema_text(cls.__metaros_name__)


def test_their_bytes_are_those_of_the_catalogues_classes() -> None:
    ours = Imu(
        header=Header(stamp=Time(sec=1, nanosec=2), frame_id="imu"),
        orientation_covariance=np.eye(3),
        angular_velocity=Vector3(z=-1.5),
        linear_acceleration_covariance=[float(n) for n in range(9)],
    )
    data = codec(Imu).encode(ours)
    theirs = codec("sensor_msgs/msg/Imu").decode(data)
    assert theirs.header.stamp.nanosec == 2
    assert theirs.orientation_covariance.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert codec("sensor_msgs/msg/Imu").encode(theirs) == data
    back = codec(Imu).decode(data)
    assert back == ours
    assert (type(back.header.stamp), back.orientation_covariance.shape) == (Time, (3, 3))
    assert back.linear_acceleration_covariance == list(range(9))


def annotation(kind: FieldType, made: dict[str, Any]) -> Any:
    """What a user would write for a field of the catalogue."""
    if kind.is_nested:
        one = made[kind.base]
    elif kind.is_string:
        one = str if kind.base == "string" else metaros.wstring
        one = Annotated[one, metaros.Bounded(kind.string_bound)] if kind.string_bound else one
    else:
        one = bool if kind.base == "bool" else getattr(metaros, kind.base)
    if not kind.array:
        return one
    marks = {"fixed": metaros.Fixed(kind.capacity), "bounded": metaros.Bounded(kind.capacity)}
    many: Any = list[one]
    if kind.base in DTYPES and kind.base not in ("byte", "char"):
        many = NDArray[DTYPES[kind.base].type]
    return Annotated[many, marks[kind.array]] if kind.array in marks else many


def rebuild(name: str, made: dict[str, Any], home: Catalogue) -> Any:
    """The message as an annotated class, after those that it is made of."""
    if name not in made:
        definition = default_catalogue().message(name)
        for field in definition.fields:
            if field.type.is_nested:
                rebuild(field.type.base, made, home)
        hints = {field.attribute: annotation(field.type, made) for field in definition.fields}
        cls = type(name.split("/")[2], (), {"__annotations__": hints, "__doc__": name})
        made[name] = metaros.message(name=name, catalogue=home)(cls)
    return made[name]


def plain_messages() -> list[str]:
    found = []
    for name in sorted(HASHES):
        _package, kind, short = name.split("/")
        if kind == "msg" and "_" not in short and name in default_catalogue():
            assert isinstance(default_catalogue().get(name), MessageDefinition)
            found.append(name)
    return found


def test_every_message_of_the_catalogue_rebuilt_has_its_golden_hash() -> None:
    made: dict[str, Any] = {}
    home = Catalogue()
    names = plain_messages()
    wrong = [name for name in names if rebuild(name, made, home).__metaros_hash__ != HASHES[name]]
    print(f"{len(names) - len(wrong)} of {len(names)} messages rebuilt with @message have the hash of rosidl")
    assert wrong == []
    assert len(names) > 150
    assert message_class("sensor_msgs/msg/Imu", home) is made["sensor_msgs/msg/Imu"]
