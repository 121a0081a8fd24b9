"""State to messages: frames, stamps, units, and that every one survives its codec."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.cdr import codec
from metaros.sim import messages
from metaros.sim.fleet import Fleet, SimRobot

STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture
def robot() -> SimRobot:
    fleet = Fleet(robots=1, seed=1)
    for _ in range(200):
        fleet.step()
    return fleet.robots[0]


def test_odometry_and_tf_agree(robot: SimRobot) -> None:
    odometry, tf = messages.odometry_message(robot, stamp_ns=STAMP_NS), messages.tf_message(robot, stamp_ns=STAMP_NS)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("sim_1/odom", "sim_1/base_link")
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    base = tf.transforms[0]
    assert (base.header.frame_id, base.child_frame_id) == ("sim_1/odom", "sim_1/base_link")
    assert base.transform.translation.x == odometry.pose.pose.position.x == robot.odometry.x
    assert base.transform.rotation == odometry.pose.pose.orientation
    turn = odometry.pose.pose.orientation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(robot.odometry.heading_rad)
    assert [part.child_frame_id for part in tf.transforms[1:]] == ["sim_1/laser", "sim_1/camera"]
    assert {part.header.frame_id for part in tf.transforms[1:]} == {"sim_1/base_link"}


def test_scan_geometry(robot: SimRobot) -> None:
    scan = messages.scan_message(robot, stamp_ns=STAMP_NS)
    assert len(scan.ranges) == 360
    assert scan.angle_min == pytest.approx(-math.pi)
    assert scan.angle_max == pytest.approx(math.pi - scan.angle_increment)
    assert (scan.range_min, scan.range_max, scan.header.frame_id) == (pytest.approx(0.12), 12.0, "sim_1/laser")


def test_battery_units(robot: SimRobot) -> None:
    battery = messages.battery_message(robot, stamp_ns=STAMP_NS)
    assert 0.0 < battery.percentage < 1.0
    assert 20.0 < battery.voltage < 29.0
    assert battery.current < 0.0
    assert battery.present
    assert math.isnan(battery.capacity)


def test_each_message_survives_its_codec(robot: SimRobot) -> None:
    reading = robot.imu.read(robot.body, dt_s=0.02)
    made = [
        messages.odometry_message(robot, stamp_ns=STAMP_NS),
        messages.scan_message(robot, stamp_ns=STAMP_NS),
        messages.imu_message(robot, reading, stamp_ns=STAMP_NS),
        messages.temperature_message(robot, stamp_ns=STAMP_NS),
        messages.camera_message(robot, b"\xff\xd8jpeg", stamp_ns=STAMP_NS),
        messages.tf_message(robot, stamp_ns=STAMP_NS),
    ]
    for message in made:
        coder = codec(message.__metaros_name__)
        encoded = coder.encode(message)
        assert coder.encode(coder.decode(encoded)) == encoded
    scan = codec("sensor_msgs/msg/LaserScan").decode(codec("sensor_msgs/msg/LaserScan").encode(made[1]))
    np.testing.assert_array_equal(scan.ranges, robot.lidar.ranges)
