"""Points, poses and their kin from frame to frame, against plain matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from metaros.ros2 import tf2_geometry_msgs
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import transform_stamped
from tests.support.ros2.random_trees import matrix_of_quaternion

AT = (1.0, 2.0, 3.0)
_ANGLE, _AXIS = 1.1, np.array([0.36, 0.48, 0.8])
TURNED = (*(_AXIS * math.sin(_ANGLE / 2)), math.cos(_ANGLE / 2))
R = matrix_of_quaternion(*TURNED)
PLACE = np.array([0.5, -1.5, 4.0])


def transform(turned: Any = TURNED) -> Any:
    return transform_stamped("map", "base", 9_000_000_000, (AT, tuple(map(float, turned))))


def made(kind: str) -> Any:
    message = interface(f"geometry_msgs/msg/{kind}")()
    message.header.frame_id = "base"
    return message


def put(field: Any, values: Any = PLACE) -> None:
    field.x, field.y, field.z = map(float, values)


def read(field: Any) -> Any:
    return np.array([field.x, field.y, field.z])


def test_places_are_turned_and_moved_vectors_only_turned() -> None:
    point, polygon, vector, wrench = (
        made("PointStamped"),
        made("PolygonStamped"),
        made("Vector3Stamped"),
        made("WrenchStamped"),
    )
    put(point.point)
    polygon.polygon.points = [interface("geometry_msgs/msg/Point32")(x=0.5, y=-1.5, z=4.0)]
    put(vector.vector)
    put(wrench.wrench.force)
    put(wrench.wrench.torque, -PLACE)
    told = transform()
    moved, turned = R @ PLACE + AT, R @ PLACE
    found = tf2_geometry_msgs.do_transform_point(point, told)
    np.testing.assert_allclose(read(found.point), moved)
    assert (found.header.frame_id, found.header.stamp.sec, point.header.frame_id) == ("map", 9, "base")
    corners = tf2_geometry_msgs.do_transform_polygon_stamped(polygon, told).polygon.points
    np.testing.assert_allclose(read(corners[0]), moved, rtol=1e-6)
    np.testing.assert_allclose(read(tf2_geometry_msgs.do_transform_vector3(vector, told).vector), turned)
    pushed = tf2_geometry_msgs.do_transform_wrench(wrench, told).wrench
    np.testing.assert_allclose(read(pushed.force), turned)
    np.testing.assert_allclose(read(pushed.torque), -turned)
    assert told == transform(), "it is not changed"


def test_poses_are_turned_in_themselves_too() -> None:
    stamped, rotation = made("PoseStamped"), made("QuaternionStamped")
    put(stamped.pose.position)
    half = math.sqrt(0.5)
    for field in (stamped.pose.orientation, rotation.quaternion):
        field.x, field.y, field.z, field.w = 0.0, 0.0, half, half
    found = tf2_geometry_msgs.do_transform_pose_stamped(stamped, transform())
    np.testing.assert_allclose(read(found.pose.position), R @ PLACE + AT)
    assert found.pose == tf2_geometry_msgs.do_transform_pose(stamped.pose, transform())
    turned = found.pose.orientation
    wanted = R @ matrix_of_quaternion(0.0, 0.0, half, half)
    np.testing.assert_allclose(matrix_of_quaternion(turned.x, turned.y, turned.z, turned.w), wanted, atol=1e-12)
    assert tf2_geometry_msgs.do_transform_quaternion(rotation, transform()).quaternion == turned
    assert turned.w >= 0


def test_covariances_are_turned_from_both_sides() -> None:
    stamped = made("PoseWithCovarianceStamped")
    stamped.pose.covariance = np.arange(36.0)
    found = tf2_geometry_msgs.do_transform_pose_with_covariance_stamped(stamped, transform())
    blocks = np.arange(36.0).reshape(2, 3, 2, 3).swapaxes(1, 2)
    wanted = np.array([[R @ block @ R.T for block in row] for row in blocks]).swapaxes(1, 2).reshape(36)
    np.testing.assert_allclose(np.asarray(found.pose.covariance), wanted)
    flipped = tf2_geometry_msgs.transform_covariance([1.0, 2.0, 3.0, 4.0, 5.0, 6.0] * 6, transform((1, 0, 0, 0)))
    assert flipped[:12].tolist() == [1.0, -2.0, -3.0, 4.0, -5.0, -6.0, -1.0, 2.0, 3.0, -4.0, 5.0, 6.0]


def test_half_a_turn_twice_is_none_and_a_zero_quaternion_turns_nothing() -> None:
    pose = interface("geometry_msgs/msg/Pose")()
    put(pose.position)
    pose.orientation.x, pose.orientation.w = 1.0, 0.0
    found = tf2_geometry_msgs.do_transform_pose(pose, transform((1, 0, 0, 0)))
    assert (found.orientation.x, found.orientation.w) == (0.0, 1.0)
    assert str(found.orientation.y) == "0.0"
    unturned = tf2_geometry_msgs.do_transform_pose(pose, transform((0, 0, 0, 0)))
    np.testing.assert_allclose(read(unturned.position), PLACE + AT)
