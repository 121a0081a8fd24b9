"""Clouds from frame to frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.sensor_msgs_py.point_cloud2 import create_cloud, create_cloud_xyz32, read_points, read_points_numpy
from metaros.ros2.tf2_py.conversions import transform_stamped
from metaros.ros2.tf2_sensor_msgs import do_transform_cloud, transform_points
from tests.support.ros2.random_trees import matrix_of_quaternion

ROWS = np.array([[1, 2, 0], [10, 20, 30], [5, 5, 5], [0, 0, 1]], np.float32)
TURNED = (0.0, 0.6 * math.sin(0.4), 0.8 * math.sin(0.4), math.cos(0.4))
MOVED = ROWS @ matrix_of_quaternion(*TURNED).T + np.array([1.0, 2.0, 3.0])


def transform() -> Any:
    return transform_stamped("map", "lidar", 9_000_000_000, ((1.0, 2.0, 3.0), TURNED))


def header() -> Any:
    return interface("std_msgs/msg/Header")(frame_id="lidar", stamp=interface("builtin_interfaces/msg/Time")(sec=3))


def test_coordinates_are_turned_and_moved() -> None:
    cloud = create_cloud_xyz32(header(), ROWS)
    before = bytes(cloud.data)
    found = do_transform_cloud(cloud, transform())
    np.testing.assert_allclose(read_points_numpy(found), MOVED, rtol=1e-6)
    assert (found.header.frame_id, found.header.stamp.sec) == ("map", 3), "its frame is new, its time is not"
    assert (bytes(cloud.data), cloud.header.frame_id) == (before, "lidar")
    plain = do_transform_cloud(cloud, transform().transform)
    assert plain.header.frame_id == "lidar", "a transform alone does not know whereto"
    np.testing.assert_allclose(transform_points(ROWS.tolist(), transform()), MOVED, rtol=1e-6)
    stretched = transform().transform
    stretched.rotation.x, stretched.rotation.w = 0.0, 3.0
    stretched.rotation.y = stretched.rotation.z = 0.0
    np.testing.assert_allclose(transform_points(ROWS, stretched), ROWS + np.array([1, 2, 3]))


def test_other_fields_and_the_shape_of_the_cloud_stay() -> None:
    field = interface("sensor_msgs/msg/PointField")
    fields = [field(name="ring", offset=16, datatype=2, count=1)]
    fields += [field(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("zyx")]
    layout = {"names": ["ring", *"zyx"], "formats": ["u1", "f4", "f4", "f4"], "offsets": [16, 0, 4, 8], "itemsize": 20}
    points = np.zeros(4, np.dtype(layout))  # type: ignore[call-overload]
    points["ring"] = [9, 8, 7, 6]
    for column, name in enumerate("xyz"):
        points[name] = ROWS[:, column]
    cloud = create_cloud(header(), fields, points)
    cloud.height, cloud.width, cloud.row_step, cloud.is_dense = 2, 2, 40, True
    found = do_transform_cloud(cloud, transform())
    assert (found.height, found.width, found.row_step, found.point_step, found.is_dense) == (2, 2, 40, 20, True)
    assert found.fields == cloud.fields
    assert read_points(found)["ring"].tolist() == [9, 8, 7, 6]
    np.testing.assert_allclose(read_points(found)["z"], MOVED[:, 2], rtol=1e-6)


def test_a_cloud_without_coordinates() -> None:
    cloud = create_cloud_xyz32(header(), ROWS)
    cloud.fields = cloud.fields[:2]
    with pytest.raises(AssertionError, match="a cloud of x, y has no x, y and z"):
        do_transform_cloud(cloud, transform())
