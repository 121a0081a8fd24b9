"""`ros2 run tf2_ros static_transform_publisher …`, which launch files use: one transform that holds for good."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from contextlib import suppress

from metaros.errors import ConfigError

__all__ = ["Frames", "main", "parse"]

_OLD = {8: ("x", "y", "z", "yaw", "pitch", "roll"), 9: ("x", "y", "z", "qx", "qy", "qz", "qw")}
_ANGLES = ("roll", "pitch", "yaw")
_QUATERNION = ("qx", "qy", "qz", "qw")


class Frames(argparse.Namespace):
    """What the command line says: frames, place in metres, and rotation as a quaternion."""

    frame_id: str
    child_frame_id: str
    place: tuple[float, float, float]
    rotation: tuple[float, float, float, float]  # x, y, z, w


def parse(words: Sequence[str]) -> Frames:
    """Read `--x … --frame-id …`, or the older `x y z yaw pitch roll FRAME CHILD` (or `qx qy qz qw`). ConfigError."""
    parser = argparse.ArgumentParser(prog="static_transform_publisher", exit_on_error=False)
    for name in ("x", "y", "z", *_ANGLES, *_QUATERNION):
        parser.add_argument(f"--{name}", type=float)
    parser.add_argument("--frame-id", default="")
    parser.add_argument("--child-frame-id", default="")
    try:
        found, unknown = parser.parse_known_args(_modern(list(words)), namespace=Frames())
    except argparse.ArgumentError as error:
        raise ConfigError(f"static_transform_publisher: {error}") from None
    if unknown:
        raise ConfigError(f"static_transform_publisher: unrecognized: {' '.join(unknown)}")
    given = {name: value for name in (*_ANGLES, *_QUATERNION) if (value := getattr(found, name)) is not None}
    if given.keys() & set(_ANGLES) and given.keys() & set(_QUATERNION):
        raise ConfigError("static_transform_publisher: angles or a quaternion, not both")
    if not (found.frame_id and found.child_frame_id) or found.frame_id == found.child_frame_id:
        raise ConfigError("static_transform_publisher: --frame-id and --child-frame-id must be given, and differ")
    found.place = found.x or 0.0, found.y or 0.0, found.z or 0.0
    if given.keys() & set(_QUATERNION):
        found.rotation = (
            given.get("qx", 0.0),
            given.get("qy", 0.0),
            given.get("qz", 0.0),
            given.get("qw", 1.0),
        )
    else:
        found.rotation = _quaternion(*(given.get(name, 0.0) for name in _ANGLES))
    return found


def main() -> None:
    """Publish it until the end."""
    from metaros.ros2 import rclpy
    from metaros.ros2.rclpy.core.utilities import remove_ros_args
    from metaros.ros2.rclpy.execution.executors import ExternalShutdownException
    from metaros.ros2.rosidl.catalogue import interface
    from metaros.ros2.tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster

    try:
        frames = parse(remove_ros_args(sys.argv)[1:])
    except ConfigError as error:
        sys.exit(str(error))
    with rclpy.init():
        node = rclpy.create_node("static_transform_publisher")
        transform = interface("geometry_msgs/msg/TransformStamped")()
        transform.header.stamp = node.get_clock().now().to_msg()
        transform.header.frame_id, transform.child_frame_id = frames.frame_id, frames.child_frame_id
        held, turned = transform.transform.translation, transform.transform.rotation
        held.x, held.y, held.z = frames.place
        turned.x, turned.y, turned.z, turned.w = frames.rotation
        StaticTransformBroadcaster(node).sendTransform(transform)
        node.get_logger().info(f"{frames.frame_id} to {frames.child_frame_id}: {frames.place}, {frames.rotation}")
        with suppress(KeyboardInterrupt, ExternalShutdownException):
            rclpy.spin(node)


def _modern(words: list[str]) -> list[str]:
    """The older form in terms of the newer one."""
    names = _OLD.get(len(words))
    if names is None or any(word.startswith("--") for word in words):
        return words
    options = [*names, "frame-id", "child-frame-id"]
    return [f"--{name}={word}" for name, word in zip(options, words, strict=True)]


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Of angles about the fixed axes x, y, z, as in REP 103."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(angle / 2), math.cos(angle / 2)) for angle in (roll, pitch, yaw))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
