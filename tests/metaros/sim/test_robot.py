"""The body: it goes where the wheels take it, stops in time, and never enters a wall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.sim.robot import DRIVE, Body, wrap_angle
from metaros.sim.warehouse import WAREHOUSE
from metaros.sim.world import Circle

STEP_S = 0.02


def body_at(x: float = 9.0, y: float = 5.4, heading_rad: float = 0.0, charge: float = 0.9) -> Body:
    return Body(WAREHOUSE, x=x, y=y, heading_rad=heading_rad, charge=charge)


def run(body: Body, linear: float, angular: float, seconds: float, **options: object) -> Body:
    for _ in range(round(seconds / STEP_S)):
        body.step(linear, angular, dt_s=STEP_S, **options)  # type: ignore[arg-type]
    return body


def test_straight_on() -> None:
    body = run(body_at(), 0.5, 0.0, 4.0)
    assert body.linear_m_s == pytest.approx(0.5)
    assert 1.8 < body.x - 9.0 < 2.0
    assert body.y == pytest.approx(5.4)


def test_turning_on_the_spot() -> None:
    body = run(body_at(), 0.0, 1.0, 2.0)
    assert body.angular_rad_s == pytest.approx(1.0)
    assert (body.x, body.y) == pytest.approx((9.0, 5.4))
    assert 1.8 < body.heading_rad < 2.0


def test_a_circle_closes() -> None:
    body = body_at(14.0, 9.0)
    run(body, 0.4, 0.8, 1.0)
    start = (body.x, body.y)
    run(body, 0.4, 0.8, math.tau / 0.8)
    assert math.dist(start, (body.x, body.y)) < 0.01


@pytest.mark.parametrize(("linear", "angular"), [(1.0, 0.0), (1.0, 1.8), (-1.0, 0.0), (0.0, 1.8)])
def test_full_speed_to_standstill_within_150_ms(linear: float, angular: float) -> None:
    body = run(body_at(), linear, angular, 2.0)
    run(body, 0.0, 0.0, 0.16)
    assert (body.left_m_s, body.right_m_s) == (0.0, 0.0)


def test_speeding_up_is_gentle_and_bounded() -> None:
    body = run(body_at(), 99.0, 0.0, 0.1)
    assert body.linear_m_s == pytest.approx(DRIVE.accel_m_s2 * 0.1)
    run(body, 99.0, 0.0, 2.0)
    assert body.linear_m_s == DRIVE.max_linear_m_s


def test_walls_hold_whatever_is_commanded() -> None:
    rng = np.random.default_rng(5)
    body = body_at()
    worst = math.inf
    for _ in range(3000):
        anything = (float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-3.0, 3.0)))
        command = anything if rng.random() < 0.03 else (1.0, 0.0)
        body.step(*command, dt_s=STEP_S)
        worst = min(worst, WAREHOUSE.clearance(body.x, body.y))
    assert worst >= DRIVE.radius_m - 1e-6


def test_running_into_a_wall_stops_the_wheels() -> None:
    body = run(body_at(1.0, 1.8, math.pi), 1.0, 0.0, 3.0)
    assert body.bumped
    assert abs(body.linear_m_s) < 0.05
    assert body.x == pytest.approx(DRIVE.radius_m)


def test_another_robot_is_as_solid_as_a_wall() -> None:
    body = run(body_at(), 1.0, 0.0, 3.0, others=(Circle(10.5, 5.4, 0.3),))
    assert body.bumped
    assert body.x <= 9.9 + 1e-9
    run(body, -0.5, 0.0, 1.0, others=(Circle(10.5, 5.4, 0.3),))
    assert body.x < 9.7


def test_a_stuck_wheel_circles_and_heats() -> None:
    healthy, broken = run(body_at(), 0.5, 0.0, 30.0), run(body_at(), 0.5, 0.0, 30.0, stuck_wheel=True)
    assert broken.left_m_s == 0.0
    assert broken.angular_rad_s > 1.0
    assert math.dist((broken.x, broken.y), (9.0, 5.4)) < 0.6
    assert broken.motor_temperature_c > healthy.motor_temperature_c + 20.0
    assert broken.battery.current_a > healthy.battery.current_a


def test_driving_costs_energy_and_nothing_gives_any_back() -> None:
    standing, driving = body_at(14.0, 1.8, math.pi / 2), body_at(14.0, 1.8, math.pi / 2)
    charges = []
    for _ in range(500):
        standing.step(0.0, 0.0, dt_s=STEP_S)
        driving.step(0.7, 0.0, dt_s=STEP_S)
        charges.append(driving.battery.charge)
    assert charges == sorted(charges, reverse=True)
    assert driving.battery.charge < standing.battery.charge < 0.9
    assert driving.battery.discharged_wh > standing.battery.discharged_wh > 0.08
    assert driving.battery.voltage_v < standing.battery.voltage_v


def test_an_empty_battery_turns_the_wheels_off() -> None:
    body = run(body_at(charge=0.0), 1.0, 0.0, 1.0)
    assert (body.x, body.linear_m_s, body.battery.current_a) == (9.0, 0.0, 0.0)


@pytest.mark.parametrize(("angle", "wrapped"), [(0.0, 0.0), (4.0, 4.0 - math.tau), (-4.0, math.tau - 4.0)])
def test_wrap_angle(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)
