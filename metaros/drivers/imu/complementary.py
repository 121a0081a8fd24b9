"""Orientation from gyroscopes and accelerometers by a complementary filter on quaternions. Pure.

Source: R. G. Valenti, I. Dryanovski, J. Xiao, "Keeping a Good Attitude: A Quaternion-Based Orientation Filter for IMUs
and MARGs", Sensors 15 (2015) 19302-19330: prediction by the gyroscopes, a small rotation that turns the predicted
gravity towards the measured one (section 5.2), its gain less while the device accelerates (adaptive gain), and the
gyroscopes' bias at rest (low pass). Here the quaternion turns the device's frame into the world's (z up), as ROS has
it. Without a magnetometer yaw is relative to the start, and drifts.
"""

from __future__ import annotations

import math
from typing import Final

from metaros.drivers.imu.sample import GRAVITY_M_S2, Quaternion, Vector

__all__ = ["ComplementaryFilter", "multiply", "rotate"]

MAX_STEP_S: Final = 0.5  # after a longer pause the orientation begins anew
_FULL_GAIN_ERROR: Final = 0.1  # of gravity; up to here accelerometers are trusted
_NO_GAIN_ERROR: Final = 0.2
_REST_ACCELERATION: Final = 0.1 * GRAVITY_M_S2
_REST_RATE_RAD_S: Final = 0.2
_REST_STEP_RAD_S: Final = 0.01  # a rate that changes more than this from sample to sample is a movement
_BIAS_S: Final = 1.0  # time constant
_SETTLED_S: Final = 0.5  # so long it must rest


class ComplementaryFilter:
    """Feed samples, read `orientation` and `bias`."""

    def __init__(self, *, gain: float, estimate_bias: bool) -> None:
        self.orientation: Quaternion | None = None
        self.bias: Vector = (0.0, 0.0, 0.0)
        self._gain = gain
        self._estimate_bias = estimate_bias
        self._rate: Vector = (0.0, 0.0, 0.0)
        self._rested_s = 0.0

    def update(self, acceleration_m_s2: Vector, rate_rad_s: Vector, step_s: float) -> None:
        """One sample, `step_s` after the one before; the first one, and one after a pause, sets roll and pitch."""
        force = math.sqrt(sum(value * value for value in acceleration_m_s2))
        if self._estimate_bias:
            self._learn(force, rate_rad_s, step_s)
        self._rate = rate_rad_s
        if self.orientation is None or not 0 <= step_s <= MAX_STEP_S:
            if force > GRAVITY_M_S2 / 2:
                self.orientation = _levelled(acceleration_m_s2)
            return
        x, y, z = ((rate - bias) * step_s for rate, bias in zip(rate_rad_s, self.bias, strict=True))
        predicted = _normal(multiply(self.orientation, _turn(x, y, z)))
        self.orientation = predicted
        gain = self._gain * _trust(force)
        if gain > 0:
            up = rotate(predicted, acceleration_m_s2)
            self.orientation = _normal(
                multiply(_part(_to_z(up[0] / force, up[1] / force, up[2] / force), gain), predicted)
            )

    def _learn(self, force: float, rate: Vector, step_s: float) -> None:
        resting = (
            abs(force - GRAVITY_M_S2) < _REST_ACCELERATION
            and all(abs(value - bias) < _REST_RATE_RAD_S for value, bias in zip(rate, self.bias, strict=True))
            and all(abs(value - last) < _REST_STEP_RAD_S for value, last in zip(rate, self._rate, strict=True))
        )
        self._rested_s = self._rested_s + step_s if resting else 0.0
        if self._rested_s > _SETTLED_S:
            part = min(1.0, step_s / _BIAS_S)
            bx, by, bz = (bias + part * (value - bias) for value, bias in zip(rate, self.bias, strict=True))
            self.bias = (bx, by, bz)


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """First b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotate(q: Quaternion, vector: Vector) -> Vector:
    """The vector, turned."""
    w, x, y, z = q
    _, rx, ry, rz = multiply(multiply(q, (0.0, *vector)), (w, -x, -y, -z))
    return (rx, ry, rz)


def _turn(x: float, y: float, z: float) -> Quaternion:
    """A rotation vector, in radians, as a quaternion."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    return (math.cos(angle / 2), x * scale, y * scale, z * scale)


def _to_z(x: float, y: float, z: float) -> Quaternion:
    """The shortest turn of a unit vector to z; of one that points down, about x."""
    if z < -0.999999:
        return (0.0, 1.0, 0.0, 0.0)
    return _normal((1 + z, y, -x, 0.0))


def _part(q: Quaternion, part: float) -> Quaternion:
    """A part of a small turn, by linear interpolation from no turn."""
    w, x, y, z = q
    return _normal((1 - part + part * w, part * x, part * y, part * z))


def _normal(q: Quaternion) -> Quaternion:
    length = math.sqrt(sum(value * value for value in q)) or 1.0
    w, x, y, z = q
    return (w / length, x / length, y / length, z / length)


def _levelled(acceleration: Vector) -> Quaternion:
    force = math.sqrt(sum(value * value for value in acceleration))
    return _to_z(acceleration[0] / force, acceleration[1] / force, acceleration[2] / force)


def _trust(force: float) -> float:
    error = abs(force - GRAVITY_M_S2) / GRAVITY_M_S2
    return min(1.0, max(0.0, (_NO_GAIN_ERROR - error) / (_NO_GAIN_ERROR - _FULL_GAIN_ERROR)))
