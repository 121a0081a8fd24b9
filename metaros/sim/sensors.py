"""What the robot's sensors report of the truth: wheel odometry that drifts, a noisy laser, a gyro with a bias.

Every sensor draws from the generator it is given and nowhere else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from metaros.sim.robot import DRIVE, Body, wrap_angle
from metaros.sim.world import Circle, Floats, ray_table

__all__ = ["LIDAR", "Imu", "ImuReading", "Lidar", "LidarSpec", "Odometry"]

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True, slots=True)
class LidarSpec:
    """A turning laser range finder in the robot's middle, first ray backwards, counter-clockwise."""

    rays: int = 360
    rate_hz: float = 10.0
    min_m: float = 0.12
    max_m: float = 12.0
    noise_m: float = 0.01
    slow_hz: float = 2.0  # scans a second under the lidar_slow fault
    dropout_lost: float = 0.7  # part of the rays lost under the lidar_dropout fault
    height_m: float = 0.25

    @property
    def first_rad(self) -> float:
        """Angle of the first ray."""
        return -math.pi

    @property
    def step_rad(self) -> float:
        """Angle between neighbouring rays."""
        return math.tau / self.rays


LIDAR = LidarSpec()
_RAYS = ray_table(LIDAR.rays, first_rad=LIDAR.first_rad, step_rad=LIDAR.step_rad)


class Lidar:
    """Scans of one robot: `ranges` as published (inf = no return), `points` the returns in the robot's frame."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._scans = 0
        self.ranges: npt.NDArray[np.float32] = np.full(LIDAR.rays, np.inf, dtype=np.float32)
        self.points: Floats = np.empty((2, 0))
        self.sight = 1.0

    def scan(self, body: Body, others: tuple[Circle, ...], *, dropout: bool) -> bool:
        """Take a scan; False when the dropout fault swallowed it whole."""
        self._scans += 1
        if dropout and self._scans % 2:
            return False
        truth = body.world.cast(body.x, body.y, body.heading_rad, _RAYS, max_m=LIDAR.max_m, others=others)
        seen = np.maximum(truth + self._rng.normal(0.0, LIDAR.noise_m, LIDAR.rays), LIDAR.min_m)
        if dropout:
            seen[self._rng.random(LIDAR.rays) < LIDAR.dropout_lost] = np.inf
        seen[seen > LIDAR.max_m] = np.inf
        returned = np.isfinite(seen)
        self.ranges = seen.astype(np.float32)
        self.points = _RAYS[:, returned] * seen[returned]
        self.sight = float(returned.mean())
        return True


class Odometry:
    """Dead reckoning from wheel turns: starts at the true pose and drifts as wheels slip."""

    def __init__(self, body: Body, rng: np.random.Generator) -> None:
        self.x, self.y, self.heading_rad = body.x, body.y, body.heading_rad
        self.linear_m_s = self.angular_rad_s = 0.0
        self.travelled_m = 0.0
        self._rng = rng

    def step(self, body: Body, *, dt_s: float) -> None:
        """Add one time step of wheel turns; slip grows with the square root of the way and with acceleration."""
        slip = self._rng.normal(0.0, 1.0, 2)
        left, right = body.left_m_s * dt_s, body.right_m_s * dt_s
        hard = 1.0 + 0.2 * abs(body.accel_m_s2)
        left += 0.0008 * hard * math.sqrt(abs(left)) * float(slip[0])
        right += 0.0008 * hard * math.sqrt(abs(right)) * float(slip[1])
        way, turn = (left + right) / 2, (right - left) / DRIVE.track_m
        middle = self.heading_rad + turn / 2
        self.x += way * math.cos(middle)
        self.y += way * math.sin(middle)
        self.heading_rad = wrap_angle(self.heading_rad + turn)
        self.linear_m_s, self.angular_rad_s = way / dt_s, turn / dt_s
        self.travelled_m += abs(way)


@dataclass(frozen=True, slots=True)
class ImuReading:
    """Body-frame angular velocity and specific force, and the heading its filter believes."""

    gyro_rad_s: tuple[float, float, float]
    accel_m_s2: tuple[float, float, float]
    heading_rad: float


class Imu:
    """A small MEMS unit in the robot's middle: white noise, and a gyro bias that its heading slowly inherits."""

    def __init__(self, body: Body, rng: np.random.Generator) -> None:
        self._rng = rng
        self._bias = float(rng.normal(0.0, 0.0004))
        self._heading = body.heading_rad

    def read(self, body: Body, *, dt_s: float) -> ImuReading:
        """One reading, `dt_s` after the last."""
        noise = self._rng.normal(0.0, 1.0, 6)
        turn = body.angular_rad_s + self._bias + 0.003 * float(noise[2])
        self._heading = wrap_angle(self._heading + turn * dt_s)
        shake = 0.02 + 0.12 * abs(body.linear_m_s)
        return ImuReading(
            (0.003 * float(noise[0]), 0.003 * float(noise[1]), turn),
            (
                body.accel_m_s2 + shake * float(noise[3]),
                body.linear_m_s * body.angular_rad_s + shake * float(noise[4]),
                GRAVITY_M_S2 + shake * float(noise[5]),
            ),
            self._heading,
        )
