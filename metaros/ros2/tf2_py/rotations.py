"""Vectors as (x, y, z) and quaternions as (x, y, z, w): plain tuples, so that a lookup needs no numpy.

Quaternions that are stored may be off unit length by a little (see `BufferCore.set_transform`); as in tf2, products
keep what they are given, and a result is brought to unit length once, at the end.
"""

from __future__ import annotations

import math
from typing import Final

__all__ = ["IDENTITY", "ORIGIN", "Quaternion", "Vector", "canonical", "conjugate", "multiply", "rotate", "slerp"]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ORIGIN: Final[Vector] = (0.0, 0.0, 0.0)
IDENTITY: Final[Quaternion] = (0.0, 0.0, 0.0, 1.0)


def multiply(left: Quaternion, right: Quaternion) -> Quaternion:
    """The rotation that is `right` first, then `left`."""
    ax, ay, az, aw = left
    bx, by, bz, bw = right
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """The opposite rotation."""
    return (-q[0], -q[1], -q[2], q[3])


def rotate(q: Quaternion, v: Vector) -> Vector:
    """The vector, rotated: the imaginary part of q v q*."""
    qx, qy, qz, qw = q
    vx, vy, vz = v
    cx, cy, cz = qy * vz - qz * vy, qz * vx - qx * vz, qx * vy - qy * vx
    keep = qw * qw - qx * qx - qy * qy - qz * qz
    along = 2.0 * (qx * vx + qy * vy + qz * vz)
    across = 2.0 * qw
    return (
        keep * vx + along * qx + across * cx,
        keep * vy + along * qy + across * cy,
        keep * vz + along * qz + across * cz,
    )


def canonical(q: Quaternion) -> Quaternion:
    """Of unit length, and of the two quaternions of a rotation the one that a rotation matrix is read as.

    That is the one whose w is positive if w is large (more than a half); else the one whose largest of x, y and z is.
    """
    x, y, z, w = q
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if length == 0.0:
        return IDENTITY
    leading = w if 4.0 * w * w > length * length else max(x, y, z, key=abs)
    if leading < 0.0:
        length = -length
    return (x / length, y / length, z / length, w / length)


def slerp(start: Quaternion, end: Quaternion, ratio: float) -> Quaternion:
    """The rotation at `ratio` (0 to 1) of the shorter way from one to the other, at an even rate."""
    dot = start[0] * end[0] + start[1] * end[1] + start[2] * end[2] + start[3] * end[3]
    lengths = math.sqrt(sum(part * part for part in start) * sum(part * part for part in end))
    cosine = min(1.0, abs(dot) / lengths) if lengths else 1.0
    angle = math.acos(cosine)
    if angle == 0.0:
        return start
    scale = 1.0 / math.sin(angle)
    a = math.sin((1.0 - ratio) * angle) * scale
    b = math.sin(ratio * angle) * scale
    if dot < 0.0:
        b = -b
    return (
        start[0] * a + end[0] * b,
        start[1] * a + end[1] * b,
        start[2] * a + end[2] * b,
        start[3] * a + end[3] * b,
    )
