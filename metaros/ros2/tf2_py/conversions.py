"""Between the messages of ROS 2 and what the tree works with. Any object with the fields will do as an input."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.rotations import Quaternion, Vector
from metaros.ros2.tf2_py.walk import Pose

__all__ = ["duration_ns", "pose_of", "time_ns", "transform_stamped"]


def time_ns(time: Any) -> int:
    """Nanoseconds of a `builtin_interfaces.msg.Time` or an `rclpy.time.Time`."""
    return _ns(time, "time")


def duration_ns(duration: Any) -> int:
    """Nanoseconds of a `builtin_interfaces.msg.Duration` or an `rclpy.duration.Duration`."""
    return _ns(duration, "duration")


def pose_of(transform: Any) -> Pose:
    """What a `geometry_msgs.msg.Transform` says.

    Raises:
        TypeError: it has no translation of x, y, z or no rotation of x, y, z, w, or they are no numbers.
    """
    at: Vector
    turned: Quaternion
    try:
        place, rotation = transform.translation, transform.rotation
        at = (float(place.x), float(place.y), float(place.z))
        turned = (float(rotation.x), float(rotation.y), float(rotation.z), float(rotation.w))
    except AttributeError as error:
        raise TypeError(
            f"a transform has translation.x, y, z and rotation.x, y, z, w: {type(transform).__name__} has not ({error})"
        ) from None
    return at, turned


def transform_stamped(frame_id: str, child_frame_id: str, stamp_ns: int, pose: Pose) -> Any:
    """A `geometry_msgs.msg.TransformStamped`."""
    made = interface("geometry_msgs/msg/TransformStamped")()
    header = made.header
    header.frame_id = frame_id
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    made.child_frame_id = child_frame_id
    at, turned = made.transform.translation, made.transform.rotation
    at.x, at.y, at.z = pose[0]
    turned.x, turned.y, turned.z, turned.w = pose[1]
    return made


def _ns(value: Any, what: str) -> int:
    sec, nanosec = getattr(value, "sec", None), getattr(value, "nanosec", None)
    if sec is not None and nanosec is not None:
        return int(sec) * 1_000_000_000 + int(nanosec)
    nanoseconds = getattr(value, "nanoseconds", None)
    if nanoseconds is None:
        raise TypeError(f"{what} must have sec and nanosec, or nanoseconds; {type(value).__name__} has neither")
    return int(nanoseconds)
