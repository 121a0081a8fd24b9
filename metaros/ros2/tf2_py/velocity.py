"""How fast a frame moves, from where it was at two times. As in tf2, whose arithmetic this follows to the letter."""

from __future__ import annotations

import math
from collections.abc import Callable

from metaros.ros2.tf2_py.rotations import ORIGIN, Quaternion, Vector, conjugate, multiply, rotate
from metaros.ros2.tf2_py.walk import Pose

__all__ = ["Twist", "twist"]

Twist = tuple[Vector, Vector]  # linear in m/s, angular in rad/s
Lookup = Callable[[str, str, int], Pose]

_FIRST_NS = 10_000  # an interval never begins at 0, which would mean the newest time


def twist(
    lookup: Lookup,
    tracking: str,
    observation: str,
    reference: str,
    point: Vector,
    point_frame: str,
    time_ns: int,
    interval_ns: int,
    latest_ns: int,
) -> Twist:
    """The velocity of `tracking` against `observation`, told in `reference` for a point that is given in `point_frame`.

    It is the mean over an interval around the time, which ends no later than the newest data.
    """
    end_ns = min(time_ns + interval_ns // 2, latest_ns)
    start_ns = max(_FIRST_NS + interval_ns, end_ns) - interval_ns
    took_s = (end_ns - start_ns) / 1e9
    start_at, start_turned = lookup(observation, tracking, start_ns)
    end_at, end_turned = lookup(observation, tracking, end_ns)
    axis, angle = _axis_angle(multiply(conjugate(start_turned), end_turned))
    linear = _scaled(_minus(end_at, start_at), 1.0 / took_s)
    angular = _scaled(rotate(start_turned, axis), angle / took_s)
    at, turned = lookup(reference, tracking, time_ns)
    out_angular = rotate(turned, angular)
    out_linear = _plus(rotate(turned, linear), _cross(at, out_angular))
    point_at, point_turned = lookup(reference, point_frame, time_ns)
    wanted = _plus(rotate(point_turned, point), point_at)
    offset = _minus(wanted, at)
    # By elements: tf2's product of two vectors, where one would expect the cross product.
    moved = (out_angular[0] * offset[0], out_angular[1] * offset[1], out_angular[2] * offset[2])
    return _plus(out_linear, moved), out_angular


def _axis_angle(q: Quaternion) -> tuple[Vector, float]:
    w = max(-1.0, min(1.0, q[3]))
    sine = 1.0 - w * w
    if sine < 1e-15:
        return (1.0, 0.0, 0.0), 2.0 * math.acos(w)
    return _scaled((q[0], q[1], q[2]), 1.0 / math.sqrt(sine)), 2.0 * math.acos(w)


def _plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _minus(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _scaled(a: Vector, by: float) -> Vector:
    return ORIGIN if by == 0.0 else (a[0] * by, a[1] * by, a[2] * by)


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
