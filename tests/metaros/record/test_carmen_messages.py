"""CARMEN records as messages: angles, frames, stamps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.record.carmen import LaserLine, OdometryLine
from metaros.record.carmen_messages import odometry_message, scan_message, tf_message

POSE = (1.0, 2.0, math.pi / 2)


def test_a_scan_of_180_readings() -> None:
    ranges = np.linspace(1.0, 81.83, 180).astype(np.float32)
    scan = scan_message("intel", LaserLine(976052857.33753, ranges, POSE, POSE))
    assert scan.angle_min == pytest.approx(-math.pi / 2)
    assert scan.angle_increment == pytest.approx(math.radians(1.0))
    assert scan.angle_max == pytest.approx(math.radians(89.0))
    assert scan.angle_min + scan.angle_increment * 90 == pytest.approx(0.0, abs=1e-6)
    assert (scan.header.stamp.sec, scan.header.stamp.nanosec) == (976052857, 337_530_000)
    assert scan.header.frame_id == "intel/laser"
    np.testing.assert_array_equal(scan.ranges, ranges)
    assert scan.range_max < 50.0


def test_a_scan_of_360_readings_has_half_the_step() -> None:
    scan = scan_message("fr079", LaserLine(1.0, np.ones(360, np.float32), POSE, POSE))
    assert scan.angle_increment == pytest.approx(math.radians(0.5))


def test_odometry_and_tf() -> None:
    line = OdometryLine(70.179699, POSE, 0.4, 0.1)
    odometry, tf = odometry_message("aces", line), tf_message("aces", line, laser_x_m=-0.04)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("aces/odom", "aces/base_link")
    assert (odometry.twist.twist.linear.x, odometry.twist.twist.angular.z) == (0.4, 0.1)
    assert odometry.pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (70, 179_699_000)
    base, laser = tf.transforms
    assert (base.transform.translation.x, base.transform.translation.y) == (1.0, 2.0)
    assert (laser.header.frame_id, laser.child_frame_id) == ("aces/base_link", "aces/laser")
    assert laser.transform.translation.x == pytest.approx(-0.04)
