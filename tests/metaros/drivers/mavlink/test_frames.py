"""Attitudes whose answer is known: where the nose and the left wing point in east-north-up."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.mavlink.frames import (
    enu_of_ned,
    flu_of_frd,
    into_body,
    orientation_of_euler,
    orientation_of_quaternion,
)

AXES = {"forward": (1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0), "up": (0.0, 0.0, 1.0)}


def axis_in_world(orientation: tuple[float, float, float, float], axis: str) -> tuple[float, float, float]:
    """Turned by the inverse of the inverse."""
    w, x, y, z = orientation
    return into_body((w, -x, -y, -z), AXES[axis])


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw", "forward", "left"),
    [
        (0, 0, 0, (0, 1, 0), (-1, 0, 0)),  # level, nose north: the left wing points west
        (0, 0, 90, (1, 0, 0), (0, 1, 0)),  # nose east
        (0, 0, 180, (0, -1, 0), (1, 0, 0)),
        (0, 90, 0, (0, 0, 1), (-1, 0, 0)),  # nose up
        (90, 0, 0, (0, 1, 0), (0, 0, 1)),  # rolled to the right: the left wing is up
    ],
)
def test_euler(
    roll: float, pitch: float, yaw: float, forward: tuple[float, float, float], left: tuple[float, float, float]
) -> None:
    orientation = orientation_of_euler(math.radians(roll), math.radians(pitch), math.radians(yaw))
    assert orientation is not None
    assert axis_in_world(orientation, "forward") == pytest.approx(forward, abs=1e-9)
    assert axis_in_world(orientation, "left") == pytest.approx(left, abs=1e-9)


angle = st.floats(-3.1, 3.1)


@given(angle, angle, angle, st.tuples(*[st.floats(-100, 100)] * 3))
def test_a_body_vector_is_the_same_by_either_way(
    roll: float, pitch: float, yaw: float, ned: tuple[float, float, float]
) -> None:
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    # The direction cosines of MAVLink's own angles: world to body, in NED and FRD.
    rows = (
        (cp * cy, cp * sy, -sp),
        (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
        (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp),
    )
    frd = tuple(sum(a * b for a, b in zip(row, ned, strict=True)) for row in rows)
    orientation = orientation_of_euler(roll, pitch, yaw)
    assert orientation is not None
    assert into_body(orientation, enu_of_ned(*ned)) == pytest.approx(flu_of_frd(*frd), abs=1e-6)


def test_a_quaternion_is_brought_to_length_one_or_refused() -> None:
    orientation = orientation_of_quaternion(1.2, 0, 0, 0)
    assert orientation is not None
    assert sum(value * value for value in orientation) == pytest.approx(1)
    assert orientation_of_quaternion(0, 0, 0, 0) is None
    assert orientation_of_quaternion(math.nan, 0, 0, 1) is None
    assert orientation_of_euler(math.inf, 0, 0) is None
