"""Sensor models: noise around the truth, and what faults do to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.sim.robot import Body
from metaros.sim.sensors import LIDAR, Imu, Lidar, Odometry
from metaros.sim.warehouse import WAREHOUSE
from metaros.sim.world import Circle


@pytest.fixture
def body() -> Body:
    return Body(WAREHOUSE, x=9.0, y=5.4, heading_rad=0.0, charge=0.9)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_scan_is_the_truth_within_noise(body: Body, rng: np.random.Generator) -> None:
    lidar = Lidar(rng)
    assert lidar.scan(body, (), dropout=False)
    assert lidar.ranges.dtype == np.float32
    assert len(lidar.ranges) == 360
    right, left = lidar.ranges[90], lidar.ranges[270]
    assert left == pytest.approx(1.2, abs=0.05)
    assert right == pytest.approx(1.2, abs=0.05)
    assert lidar.sight > 0.9
    assert lidar.ranges[np.isfinite(lidar.ranges)].max() <= LIDAR.max_m
    np.testing.assert_allclose(
        np.hypot(*lidar.points), lidar.ranges[np.isfinite(lidar.ranges)].astype(np.float64), rtol=1e-6
    )


def test_scan_sees_other_robots(body: Body, rng: np.random.Generator) -> None:
    lidar = Lidar(rng)
    lidar.scan(body, (Circle(10.5, 5.4, 0.3),), dropout=False)
    assert lidar.ranges[180] == pytest.approx(1.2, abs=0.05)


def test_dropout_loses_rays_and_scans(body: Body, rng: np.random.Generator) -> None:
    lidar = Lidar(rng)
    taken = [lidar.scan(body, (), dropout=True) for _ in range(10)]
    assert sum(taken) == 5
    assert lidar.sight < 0.45


def test_odometry_follows_the_wheels_and_drifts(body: Body, rng: np.random.Generator) -> None:
    odometry = Odometry(body, rng)
    for _ in range(60 * 50):
        body.step(0.3, 0.5, dt_s=0.02)
        odometry.step(body, dt_s=0.02)
    off = math.dist((odometry.x, odometry.y), (body.x, body.y))
    assert 1e-6 < off < 0.5
    assert odometry.travelled_m == pytest.approx(18.0, abs=0.5)
    assert odometry.linear_m_s == pytest.approx(0.3, abs=0.1)


def test_odometry_of_a_standing_robot_is_still(body: Body, rng: np.random.Generator) -> None:
    odometry = Odometry(body, rng)
    for _ in range(50):
        body.step(0.0, 0.0, dt_s=0.02)
        odometry.step(body, dt_s=0.02)
    assert (odometry.x, odometry.y, odometry.linear_m_s, odometry.angular_rad_s) == (9.0, 5.4, 0.0, 0.0)


def test_imu_feels_gravity_and_turns(body: Body, rng: np.random.Generator) -> None:
    imu = Imu(body, rng)
    for _ in range(100):
        body.step(0.3, 0.5, dt_s=0.02)
    readings = [imu.read(body, dt_s=0.02) for _ in range(400)]
    assert np.mean([reading.accel_m_s2[2] for reading in readings]) == pytest.approx(9.81, abs=0.02)
    assert np.mean([reading.gyro_rad_s[2] for reading in readings]) == pytest.approx(0.5, abs=0.01)
    assert np.mean([reading.accel_m_s2[1] for reading in readings]) == pytest.approx(0.15, abs=0.02)
    assert readings[-1].heading_rad != readings[0].heading_rad
