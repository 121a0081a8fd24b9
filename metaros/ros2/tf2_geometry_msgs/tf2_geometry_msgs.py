"""How geometry_msgs' stamped types go from frame to frame. Importing this tells `tf2_ros.Buffer.transform` of them.

Functions take the message and the TransformStamped that leads to the other frame, change neither, and give a message
with the time and the frame of the transform.
"""

from __future__ import annotations

from typing import Any

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import pose_of
from metaros.ros2.tf2_py.rotations import Quaternion, Vector, multiply, rotate
from metaros.ros2.tf2_ros.registrations import ConvertRegistration, TransformRegistration

__all__ = [
    "do_transform_point",
    "do_transform_polygon_stamped",
    "do_transform_pose",
    "do_transform_pose_stamped",
    "do_transform_pose_with_covariance_stamped",
    "do_transform_quaternion",
    "do_transform_vector3",
    "do_transform_wrench",
    "from_msg_msg",
    "to_msg_msg",
    "transform_covariance",
]


def to_msg_msg(msg: Any) -> Any:
    """A message is one already."""
    return msg


def from_msg_msg(msg: Any) -> Any:
    """A message is what is wanted."""
    return msg


def do_transform_point(point: Any, transform: Any) -> Any:
    """A PointStamped in the other frame."""
    made = _made("PointStamped", transform)
    _put(made.point, _moved(transform, _vector(point.point)))
    return made


def do_transform_vector3(vector3: Any, transform: Any) -> Any:
    """A Vector3Stamped in the other frame: turned, not moved, as it is no place."""
    made = _made("Vector3Stamped", transform)
    _put(made.vector, rotate(_unit(transform), _vector(vector3.vector)))
    return made


def do_transform_quaternion(quaternion: Any, transform: Any) -> Any:
    """A QuaternionStamped in the other frame."""
    made = _made("QuaternionStamped", transform)
    _put_rotation(made.quaternion, multiply(_unit(transform), _rotation(quaternion.quaternion)))
    return made


def do_transform_pose(pose: Any, transform: Any) -> Any:
    """A Pose, without a header, in the other frame."""
    made = interface("geometry_msgs/msg/Pose")()
    _put(made.position, _moved(transform, _vector(pose.position)))
    _put_rotation(made.orientation, multiply(_unit(transform), _rotation(pose.orientation)))
    return made


def do_transform_pose_stamped(pose: Any, transform: Any) -> Any:
    """A PoseStamped in the other frame."""
    made = _made("PoseStamped", transform)
    made.pose = do_transform_pose(pose.pose, transform)
    return made


def do_transform_pose_with_covariance_stamped(pose: Any, transform: Any) -> Any:
    """A PoseWithCovarianceStamped in the other frame, its covariance turned with it."""
    made = _made("PoseWithCovarianceStamped", transform)
    made.pose.pose = do_transform_pose(pose.pose.pose, transform)
    made.pose.covariance = transform_covariance(pose.pose.covariance, transform)
    return made


def do_transform_wrench(wrench: Any, transform: Any) -> Any:
    """A WrenchStamped in the other frame: force and torque turned, as tf2_geometry_msgs does it in C++."""
    made = _made("WrenchStamped", transform)
    turned = _unit(transform)
    _put(made.wrench.force, rotate(turned, _vector(wrench.wrench.force)))
    _put(made.wrench.torque, rotate(turned, _vector(wrench.wrench.torque)))
    return made


def do_transform_polygon_stamped(polygon: Any, transform: Any) -> Any:
    """A PolygonStamped in the other frame."""
    made = _made("PolygonStamped", transform)
    point = interface("geometry_msgs/msg/Point32")
    for corner in polygon.polygon.points:
        x, y, z = _moved(transform, _vector(corner))
        made.polygon.points.append(point(x=x, y=y, z=z))
    return made


def transform_covariance(cov_in: Any, transform: Any) -> Any:
    """The 6x6 covariance of a pose (36 numbers, row by row), turned: each of its four 3x3 blocks, from both sides."""
    import numpy as np  # here, as points and poses need none

    x, y, z, w = _unit(transform)
    turn = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = turn
    return (both @ np.asarray(cov_in, np.float64).reshape(6, 6) @ both.T).reshape(36)


def _made(kind: str, transform: Any) -> Any:
    """A new message, with a header of its own that says what the transform's says."""
    made = interface(f"geometry_msgs/msg/{kind}")()
    said, header = transform.header, made.header
    header.frame_id = said.frame_id
    header.stamp.sec, header.stamp.nanosec = said.stamp.sec, said.stamp.nanosec
    return made


def _moved(transform: Any, place: Vector) -> Vector:
    at, _ = pose_of(transform.transform)
    x, y, z = rotate(_unit(transform), place)
    return (x + at[0], y + at[1], z + at[2])


def _unit(transform: Any) -> Quaternion:
    """The rotation, of unit length; none at all where the quaternion is zero."""
    _, (x, y, z, w) = pose_of(transform.transform)
    length = (x * x + y * y + z * z + w * w) ** 0.5
    return (x / length, y / length, z / length, w / length) if length else (0.0, 0.0, 0.0, 1.0)


def _vector(point: Any) -> Vector:
    return (float(point.x), float(point.y), float(point.z))


def _rotation(orientation: Any) -> Quaternion:
    return (float(orientation.x), float(orientation.y), float(orientation.z), float(orientation.w))


def _put(field: Any, place: Vector) -> None:
    field.x, field.y, field.z = place


def _put_rotation(field: Any, turned: Quaternion) -> None:
    """Of the two quaternions of a rotation the one whose w is not negative."""
    sign = -1.0 if turned[3] < 0 else 1.0
    field.x, field.y, field.z, field.w = (sign * part + 0.0 for part in turned)  # 0.0: no -0.0


def _register() -> None:
    functions = {
        "PointStamped": do_transform_point,
        "PolygonStamped": do_transform_polygon_stamped,
        "PoseStamped": do_transform_pose_stamped,
        "PoseWithCovarianceStamped": do_transform_pose_with_covariance_stamped,
        "QuaternionStamped": do_transform_quaternion,
        "Vector3Stamped": do_transform_vector3,
        "WrenchStamped": do_transform_wrench,
    }
    transforms, converts = TransformRegistration(), ConvertRegistration()
    for name, function in functions.items():
        kind = interface(f"geometry_msgs/msg/{name}")
        transforms.add(kind, function)
        converts.add_to_msg(kind, to_msg_msg)
        converts.add_from_msg(kind, from_msg_msg)


_register()
