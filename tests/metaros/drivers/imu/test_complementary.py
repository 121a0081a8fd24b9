"""The complementary filter, against movements whose end is known."""

from __future__ import annotations

import math
from random import Random  # noqa: TID251 - seeded

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.imu.complementary import ComplementaryFilter, rotate
from metaros.drivers.imu.sample import GRAVITY_M_S2, Quaternion, Vector
from metaros.drivers.imu.witmotion import from_euler

STEP_S = 0.01


def turned_back(q: Quaternion, vector: Vector) -> Vector:
    """What the device feels of a vector of the world."""
    w, x, y, z = q
    return rotate((w, -x, -y, -z), vector)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    return 2 * math.acos(min(1.0, abs(sum(left * right for left, right in zip(a, b, strict=True)))))


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.5, 0.0), (0.0, -1.2), (-2.5, 0.4), (3.1415, 0.0)])
def test_the_first_sample_sets_roll_and_pitch(roll: float, pitch: float) -> None:
    filter_ = ComplementaryFilter(gain=0.02, estimate_bias=False)
    force = turned_back(from_euler(roll, pitch, 0.0), (0.0, 0.0, GRAVITY_M_S2))
    filter_.update(force, (0.0, 0.0, 0.0), 0.0)
    assert filter_.orientation is not None
    assert rotate(filter_.orientation, force) == pytest.approx((0, 0, GRAVITY_M_S2), abs=1e-3)


def test_a_turn_about_each_axis_is_followed() -> None:
    for axis in range(3):
        filter_ = ComplementaryFilter(gain=0.02, estimate_bias=True)
        filter_.update((0.0, 0.0, GRAVITY_M_S2), (0.0, 0.0, 0.0), 0.0)
        for step in range(100):
            angles = [0.0, 0.0, 0.0]
            angles[axis] = (step + 1) * STEP_S * math.pi / 4
            rate = [0.0, 0.0, 0.0]
            rate[axis] = math.pi / 4
            force = turned_back(from_euler(*angles), (0.0, 0.0, GRAVITY_M_S2))
            filter_.update(force, (rate[0], rate[1], rate[2]), STEP_S)
        wanted = [0.0, 0.0, 0.0]
        wanted[axis] = math.pi / 4
        assert filter_.orientation is not None
        assert angle_between(filter_.orientation, from_euler(*wanted)) < 0.005, axis


def test_a_bias_is_learnt_at_rest_and_the_orientation_stays() -> None:
    rng = Random(11)
    filter_ = ComplementaryFilter(gain=0.02, estimate_bias=True)
    bias = (0.02, -0.01, 0.03)
    for _ in range(1000):
        x, y, z = (value + rng.gauss(0, 0.001) for value in bias)
        filter_.update((rng.gauss(0, 0.02), rng.gauss(0, 0.02), GRAVITY_M_S2 + rng.gauss(0, 0.02)), (x, y, z), STEP_S)
    assert filter_.bias == pytest.approx(bias, abs=0.001)
    level = from_euler(0.0, 0.0, 0.0)
    assert filter_.orientation is not None
    assert angle_between(filter_.orientation, level) < 0.06  # the yaw of the second before the bias was known


def test_no_bias_is_learnt_while_it_turns() -> None:
    filter_ = ComplementaryFilter(gain=0.02, estimate_bias=True)
    for step in range(500):
        filter_.update((0.0, 0.0, GRAVITY_M_S2), (0.0, 0.0, math.sin(step / 20)), STEP_S)
    assert filter_.bias == pytest.approx((0, 0, 0), abs=0.01)


def test_pushing_the_device_does_not_tilt_it_much() -> None:
    pushed, trusting = (ComplementaryFilter(gain=gain, estimate_bias=False) for gain in (0.02, 0.02))
    for filter_, force in ((pushed, 2 * GRAVITY_M_S2), (trusting, 0.1 * GRAVITY_M_S2)):
        filter_.update((0.0, 0.0, GRAVITY_M_S2), (0.0, 0.0, 0.0), 0.0)
        for _ in range(50):
            filter_.update((force, 0.0, GRAVITY_M_S2), (0.0, 0.0, 0.0), STEP_S)
    level = from_euler(0.0, 0.0, 0.0)
    assert pushed.orientation is not None
    assert trusting.orientation is not None
    assert angle_between(pushed.orientation, level) < 1e-9
    assert 0.03 < angle_between(trusting.orientation, level) < 0.11


def test_after_a_pause_it_begins_anew() -> None:
    filter_ = ComplementaryFilter(gain=0.02, estimate_bias=False)
    filter_.update((0.0, 0.0, GRAVITY_M_S2), (0.0, 0.0, 0.0), 0.0)
    on_its_side = turned_back(from_euler(1.0, 0.0, 0.0), (0.0, 0.0, GRAVITY_M_S2))
    filter_.update(on_its_side, (50.0, 0.0, 0.0), 10.0)
    assert filter_.orientation is not None
    assert angle_between(filter_.orientation, from_euler(1.0, 0.0, 0.0)) < 1e-6


def test_falling_before_the_first_sample_gives_no_orientation() -> None:
    filter_ = ComplementaryFilter(gain=0.02, estimate_bias=True)
    filter_.update((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), STEP_S)
    assert filter_.orientation is None


NUMBERS = st.floats(-400, 400)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.tuples(*[NUMBERS] * 3), st.tuples(*[NUMBERS] * 3), st.floats(0, 1)), max_size=20))
def test_whatever_is_plausible_gives_a_unit_quaternion(samples: list[tuple[Vector, Vector, float]]) -> None:
    filter_ = ComplementaryFilter(gain=0.5, estimate_bias=True)
    for force, rate, step_s in samples:
        filter_.update(force, rate, step_s)
    assert filter_.orientation is None or math.hypot(*filter_.orientation) == pytest.approx(1)
