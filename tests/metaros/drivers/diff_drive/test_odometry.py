"""Kinematics and odometry against geometry."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.diff_drive.kinematics import Pose, Wheels, moved, wrapped
from metaros.drivers.diff_drive.odometry import Odometer

WHEELS = Wheels(radius_m=0.05, separation_m=0.3, ticks_per_turn=1000)


def driven(odometer: Odometer, steps: int, linear: float, angular: float, state: list[float]) -> None:
    """Let the counts grow as wheels do at these speeds, 50 times a second."""
    for _ in range(steps):
        left, right = WHEELS.ticks(linear / 50, angular / 50)
        state[:] = [state[0] + left, state[1] + right, state[2] + 0.02]
        assert odometer.feed((math.floor(state[0]), math.floor(state[1])), state[2], error=0.05)


@settings(deadline=None)
@given(st.floats(-2, 2), st.floats(-5, 5), st.sampled_from([-1, 1]), st.sampled_from([-1, 1]))
def test_ticks_and_way_are_each_others_inverse(linear: float, angular: float, left: int, right: int) -> None:
    wheels = Wheels(radius_m=0.05, separation_m=0.3, ticks_per_turn=1000, left_sign=left, right_sign=right)
    assert wheels.way(*wheels.ticks(linear, angular)) == pytest.approx((linear, angular), abs=1e-9)


def test_a_step_is_an_exact_arc() -> None:
    quarter = moved(Pose(), math.pi / 2, math.pi / 2, error=0.0)  # of a circle with a radius of one metre
    assert (quarter.x, quarter.y, quarter.yaw) == pytest.approx((1.0, 1.0, math.pi / 2))
    assert moved(Pose(), 2.0, 0.0, error=0.0).x == 2.0


def test_a_square_leads_back_to_its_begin() -> None:
    odometer, state = Odometer(WHEELS, max_ticks_s=10_000), [0.0, 0.0, 0.0]
    odometer.feed((0, 0), 0.0, error=0.05)
    for _ in range(4):
        driven(odometer, 100, 0.5, 0.0, state)
        driven(odometer, 50, 0.0, math.pi / 2, state)
    pose = odometer.pose
    assert math.hypot(pose.x, pose.y) < 0.005
    assert abs(pose.yaw) < 0.005
    assert pose.place_variance > 4 * 0.05**2
    assert pose.yaw_variance == pytest.approx(0.05**2 * 2 * math.pi, rel=0.02)


def test_speeds_and_wheels_are_reported() -> None:
    odometer, state = Odometer(WHEELS, max_ticks_s=10_000), [0.0, 0.0, 0.0]
    odometer.feed((0, 0), 0.0, error=0.05)
    driven(odometer, 100, 0.5, 0.0, state)
    assert odometer.linear == pytest.approx(0.5, abs=0.02)
    assert odometer.angular == pytest.approx(0.0, abs=0.06)
    assert odometer.angles == pytest.approx((1.0 / 0.05, 1.0 / 0.05), rel=0.01)
    assert odometer.rates == pytest.approx((10.0, 10.0), rel=0.05)


def test_counts_wrap_at_32_bits() -> None:
    odometer = Odometer(WHEELS, max_ticks_s=10_000)
    odometer.feed((2**31 - 50, -(2**31) + 50), 0.0, error=0.0)
    assert odometer.feed((-(2**31) + 50, 2**31 - 50), 0.1, error=0.0)
    assert odometer.angles[0] == pytest.approx(100 * WHEELS.tick_rad)
    assert odometer.angles[1] == pytest.approx(-100 * WHEELS.tick_rad)


def test_a_jump_moves_nothing_and_the_next_counts_go_on_from_there() -> None:
    odometer = Odometer(WHEELS, max_ticks_s=1000)
    assert odometer.feed((5000, 5000), 0.0, error=0.0)
    assert odometer.feed((5010, 5010), 0.1, error=0.0)
    before = odometer.pose
    assert not odometer.feed((0, 0), 0.2, error=0.0)
    assert (odometer.pose, odometer.linear) == (before, 0.0)
    assert odometer.feed((10, 10), 0.3, error=0.0)
    assert odometer.pose.x == pytest.approx(2 * before.x)


def test_a_late_answer_is_no_jump_nor_are_the_counts_after_it() -> None:
    odometer = Odometer(WHEELS, max_ticks_s=1000)
    odometer.feed((0, 0), 0.0, error=0.0)
    assert odometer.feed((10, 10), 3.02, error=0.0, asked_s=0.02)  # counted at once, and then three seconds on its way
    assert odometer.feed((1520, 1520), 3.04, error=0.0, asked_s=3.03)
    assert odometer.angles[0] == pytest.approx(1520 * WHEELS.tick_rad)
    assert odometer.rates[0] < 2 * 500 * WHEELS.tick_rad, "no burst"
    assert not odometer.feed((1700, 1700), 3.06, error=0.0, asked_s=3.05)


def test_after_a_pause_the_first_counts_are_where_it_stands() -> None:
    odometer = Odometer(WHEELS, max_ticks_s=1000)
    odometer.feed((0, 0), 0.0, error=0.0)
    odometer.feed((10, 10), 0.1, error=0.0)
    before = odometer.pose
    odometer.begin()
    assert odometer.feed((999_999, -5), 9.0, error=0.0)
    assert odometer.pose == before


@settings(deadline=None)
@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**20), 2**20))
def test_a_difference_is_right_over_the_wrap(count: int, step: int) -> None:
    after = (count + step + 2**31) % 2**32 - 2**31
    assert wrapped(after - count) == step
