"""From the frames of MAVLink (north-east-down, forward-right-down) to those of ROS (REP 103): ENU and FLU. Pure."""

from __future__ import annotations

import math
from typing import Final

__all__ = ["enu_of_ned", "flu_of_frd", "into_body", "orientation_of_euler", "orientation_of_quaternion"]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z

_HALF: Final = math.sqrt(0.5)


def enu_of_ned(north: float, east: float, down: float) -> Vector:
    """The same vector as east, north, up."""
    return (east, north, -down)


def flu_of_frd(forward: float, right: float, down: float) -> Vector:
    """The same vector as forward, left, up; and back again, for it is its own inverse."""
    return (forward, -right, -down)


def orientation_of_quaternion(w: float, x: float, y: float, z: float) -> Quaternion | None:
    """The attitude of FRD in NED as that of FLU in ENU, of length one; None where it is no rotation.

    It is q(NED to ENU) * q * q(FLU to FRD): half turns about the axis between north and east, and about forward.
    """
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not (math.isfinite(length) and 0.5 < length < 2.0):
        return None
    scale = _HALF / length
    return (scale * (w + z), scale * (x + y), scale * (x - y), scale * (w - z))


def orientation_of_euler(roll: float, pitch: float, yaw: float) -> Quaternion | None:
    """The same from MAVLink's angles in radians: yaw, then pitch, then roll."""
    if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
        return None
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return orientation_of_quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def into_body(orientation: Quaternion, vector: Vector) -> Vector:
    """A vector of the world as the body has it: turned back by the body's orientation."""
    w, x, y, z = orientation
    a, b, c = vector
    return (
        (1 - 2 * (y * y + z * z)) * a + 2 * (x * y + w * z) * b + 2 * (x * z - w * y) * c,
        2 * (x * y - w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + w * x) * c,
        2 * (x * z + w * y) * a + 2 * (y * z - w * x) * b + (1 - 2 * (x * x + y * y)) * c,
    )
