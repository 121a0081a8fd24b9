"""What may move the base."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.diff_drive.command import CommandGate


def gate(**limits: float) -> CommandGate:
    wanted = {
        "max_linear": 1.0,
        "max_angular": 2.0,
        "linear_acceleration": 100.0,
        "angular_acceleration": 100.0,
        "watchdog_s": 0.3,
    }
    made = CommandGate(**(wanted | limits))
    made.speeds(0.0)
    return made


def test_nothing_moves_without_a_command() -> None:
    assert gate().speeds(100.0) == (0.0, 0.0)


def test_a_command_holds_for_the_watchdog() -> None:
    made = gate()
    assert made.command(0.5, -1.0, 0.1)
    assert made.speeds(0.2) == (0.5, -1.0)
    assert made.speeds(0.39) == (0.5, -1.0)
    assert made.speeds(0.4) == (0.0, 0.0)
    assert made.speeds(0.5) == (0.0, 0.0)


def test_speeds_are_limited_and_approached_by_the_acceleration() -> None:
    made = gate(linear_acceleration=1.0, angular_acceleration=2.0)
    made.command(9.0, -9.0, 0.0)
    assert made.speeds(0.1) == pytest.approx((0.1, -0.2))
    assert made.speeds(0.2) == pytest.approx((0.2, -0.4))
    made.command(-1.0, 0.0, 0.2)
    assert made.speeds(0.3) == pytest.approx((0.1, -0.2))


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_and_does_not_refresh(wrong: float) -> None:
    made = gate()
    made.command(0.5, 0.0, 0.0)
    assert not made.command(wrong, 0.0, 0.2)
    assert not made.command(0.0, wrong, 0.2)
    assert made.speeds(0.25) == (0.5, 0.0)
    assert made.speeds(0.35) == (0.0, 0.0)


def test_stop_is_at_once_and_release_needs_a_new_command() -> None:
    made = gate()
    made.command(0.5, 0.0, 0.0)
    made.speeds(0.1)
    made.stop()
    assert made.stopped
    assert made.speeds(0.11) == (0.0, 0.0)
    assert not made.command(0.5, 0.0, 0.12)
    made.release()
    assert made.speeds(0.13) == (0.0, 0.0)
    assert made.command(0.5, 0.0, 0.14)
    assert made.speeds(0.2) == (0.5, 0.0)


def test_forgetting_needs_a_new_command() -> None:
    made = gate()
    made.command(0.5, 0.0, 0.0)
    made.forget()
    assert made.speeds(0.1) == (0.0, 0.0)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(), st.floats(), st.floats(0, 1)), max_size=20))
def test_speeds_are_always_within_the_limits(commands: list[tuple[float, float, float]]) -> None:
    made, now_s = gate(), 0.0
    for linear, angular, step_s in commands:
        made.command(linear, angular, now_s)
        now_s += step_s
        speeds = made.speeds(now_s)
        assert abs(speeds[0]) <= 1.0
        assert abs(speeds[1]) <= 2.0
