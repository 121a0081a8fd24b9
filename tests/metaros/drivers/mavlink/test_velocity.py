"""Limits, the watchdog, and what is said when commands end."""

from __future__ import annotations

import math

import pytest

from metaros.drivers.mavlink.velocity import FAREWELL_S, VelocityGate


def gate() -> VelocityGate:
    return VelocityGate((2.0, 1.0, 0.5), watchdog_s=0.3)


def test_nothing_is_said_before_the_first_command() -> None:
    assert gate().velocity(0.0) is None


def test_a_command_then_zero_then_nothing() -> None:
    it = gate()
    assert it.command((1.0, 0.0, 0.0, 0.1), 10.0)
    assert it.velocity(10.29) == (1.0, 0.0, 0.0, 0.1)
    assert it.velocity(10.3) == (0.0, 0.0, 0.0, 0.0)
    assert it.velocity(10.3 + FAREWELL_S) is None
    assert not it.forget()  # there was nothing left to take back


def test_limits_keep_the_direction() -> None:
    it = gate()
    assert it.command((30.0, -40.0, -9.0, 9.0), 0.0)
    assert it.velocity(0.1) == pytest.approx((1.2, -1.6, -1.0, 0.5))
    assert it.command((1e308, 1e308, 0.0, 0.0), 0.0)
    assert all(map(math.isfinite, it.velocity(0.1) or (math.nan,)))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_and_does_not_feed_the_watchdog(bad: float) -> None:
    it = gate()
    assert it.command((1.0, 0.0, 0.0, 0.0), 0.0)
    for place in range(4):
        values = [0.0] * 4
        values[place] = bad
        assert not it.command((values[0], values[1], values[2], values[3]), 0.2)
    assert it.velocity(0.3) == (0.0, 0.0, 0.0, 0.0)


def test_forgotten_commands_do_not_come_back() -> None:
    it = gate()
    it.command((1.0, 0.0, 0.0, 0.0), 0.0)
    assert it.forget()
    assert it.velocity(0.1) is None
