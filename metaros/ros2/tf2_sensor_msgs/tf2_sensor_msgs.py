"""How point clouds go from frame to frame. Importing this tells `tf2_ros.Buffer.transform` of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.sensor_msgs_py.point_cloud2 import create_cloud, read_points
from metaros.ros2.tf2_py.conversions import pose_of
from metaros.ros2.tf2_ros.registrations import ConvertRegistration, TransformRegistration

__all__ = ["do_transform_cloud", "from_msg_msg", "to_msg_msg", "transform_points"]


def to_msg_msg(msg: Any) -> Any:
    """A message is one already."""
    return msg


def from_msg_msg(msg: Any) -> Any:
    """A message is what is wanted."""
    return msg


def transform_points(point_cloud: npt.ArrayLike, transform: Any) -> npt.NDArray[Any]:
    """Points as rows of x, y, z, turned and moved by a Transform or a TransformStamped."""
    at, (x, y, z, w) = pose_of(getattr(transform, "transform", transform))
    norm = x * x + y * y + z * z + w * w
    turn = np.eye(3)
    if norm > np.finfo(np.float64).eps:
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # by Rodrigues' formula, for a quaternion of any length
        turn += 2.0 / norm * (w * cross + cross @ cross)
    moved: npt.NDArray[Any] = np.asarray(point_cloud) @ turn.T + np.array(at)
    return moved


def do_transform_cloud(cloud: Any, transform: Any) -> Any:
    """A PointCloud2 whose x, y and z are turned and moved; its other fields stay as they are.

    The header has the cloud's time, and the frame of a TransformStamped.

    Raises:
        AssertionError: the cloud has no x, y and z.
    """
    names = [field.name for field in cloud.fields]
    if not {"x", "y", "z"} <= set(names):
        raise AssertionError(f"a cloud of {', '.join(names) or 'no fields'} has no x, y and z to be transformed")
    stamped = getattr(transform, "header", None)
    header = interface("std_msgs/msg/Header")(
        stamp=cloud.header.stamp, frame_id=cloud.header.frame_id if stamped is None else stamped.frame_id
    )
    points = read_points(cloud).copy()
    xyz = np.stack([points[name] for name in "xyz"], axis=-1)
    for name, column in zip("xyz", transform_points(xyz, transform).T, strict=True):
        points[name] = column
    made = create_cloud(header, cloud.fields, points)
    made.is_dense = cloud.is_dense
    if cloud.height > 1:
        made.height, made.width, made.row_step = cloud.height, cloud.width, cloud.width * cloud.point_step
    return made


def _register() -> None:
    kind = interface("sensor_msgs/msg/PointCloud2")
    TransformRegistration().add(kind, do_transform_cloud)
    ConvertRegistration().add_to_msg(kind, to_msg_msg)
    ConvertRegistration().add_from_msg(kind, from_msg_msg)


_register()
