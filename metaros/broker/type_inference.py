"""Infers the ROS type of a ZeroMQ topic that no node has declared: user's table, marker in the JSON, fields. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from metaros.errors import ConfigError, MetarosError
from metaros.idl import default_catalogue
from metaros.idl.globs import Glob

__all__ = ["BYTES", "JSON", "TEXT", "TYPE_MARKER", "TypeTable", "infer_type", "known_type"]

TYPE_MARKER: Final = "_type"  # {"_type": "sensor_msgs/BatteryState", …}: a program that knows the ROS type says it
TEXT: Final = "std_msgs/msg/String"
JSON: Final = "metaros_msgs/msg/Json"  # what a node's `dict` and `list` topics are
BYTES: Final = "metaros_msgs/msg/Bytes"  # what its `bytes` topics are

# What the message classes of `metaros` 1.x write: {"data": …} is told apart by its value.
_SHAPES: Final[Mapping[frozenset[str], str]] = {
    frozenset(fields.split()): f"{package}/msg/{name}"
    for fields, package, name in (
        ("seq stamp frame_id", "std_msgs", "Header"),
        ("x y z", "geometry_msgs", "Vector3"),
        ("x y z w", "geometry_msgs", "Quaternion"),
        ("linear angular", "geometry_msgs", "Twist"),
        ("position orientation", "geometry_msgs", "Pose"),
        ("header vector", "geometry_msgs", "Vector3Stamped"),
        ("header pose", "geometry_msgs", "PoseStamped"),
        ("pose covariance", "geometry_msgs", "PoseWithCovariance"),
        ("twist covariance", "geometry_msgs", "TwistWithCovariance"),
        ("header child_frame_id pose twist", "nav_msgs", "Odometry"),
        ("header poses", "nav_msgs", "Path"),
        ("header height width encoding is_bigendian step data", "sensor_msgs", "Image"),
        (
            "header angle_min angle_max angle_increment time_increment scan_time range_min range_max ranges "
            "intensities angles",
            "sensor_msgs",
            "LaserScan",
        ),
    )
}


def infer_type(value: Any) -> str:
    """The ROS type for what `parse_payload` gave; `JSON` for what looks like nothing known."""
    if isinstance(value, bytes):
        return BYTES
    if not isinstance(value, dict):
        return _primitive(value)
    if TYPE_MARKER in value:
        marked = known_type(str(value[TYPE_MARKER]))
        if marked is not None:
            return marked
    if len(value) == 1 and "data" in value:
        return _primitive(value["data"])
    return _SHAPES.get(frozenset(value), JSON)


def _primitive(value: Any) -> str:
    if isinstance(value, bool):
        return "std_msgs/msg/Bool"
    if isinstance(value, int):
        return "std_msgs/msg/Int64" if -(1 << 63) <= value < 1 << 63 else "std_msgs/msg/Float64"
    if isinstance(value, float):
        return "std_msgs/msg/Float64"
    return TEXT if isinstance(value, str) else JSON


def known_type(name: str) -> str | None:
    """The full name of a message type as people write it (`std_msgs/String`); None where the catalogue has none."""
    parts = name.split("/")
    full = f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name
    return full if full.count("/msg/") == 1 and full in default_catalogue() else None


@dataclass(frozen=True, slots=True)
class TypeTable:
    """The user's own rules, `--map TOPIC=TYPE`: the first that fits a topic holds."""

    rules: tuple[tuple[Glob, str], ...] = ()

    @classmethod
    def parse(cls, texts: Iterable[str]) -> TypeTable:
        """`/chatter=std_msgs/msg/String`, `**/odom=nav_msgs/Odometry`; ConfigError names what is wrong."""
        return cls(tuple(_rule(text) for text in texts))

    def type_of(self, topic: str) -> str | None:
        """The type that the rules give `topic`."""
        return next((type_name for glob, type_name in self.rules if glob.matches(topic)), None)


def _rule(text: str) -> tuple[Glob, str]:
    topic, equals, type_name = text.partition("=")
    if not equals:
        raise ConfigError(f"--map {text}: expected TOPIC=TYPE, such as /chatter=std_msgs/msg/String")
    full = known_type(type_name)
    if full is None:
        raise ConfigError(
            f"--map {text}: no message type {type_name!r}: `metaros interface list` shows those there are"
        )
    try:
        return Glob(topic), full
    except MetarosError as error:
        raise ConfigError(f"--map {text}: {error}") from None
