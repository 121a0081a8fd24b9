"""Driving by a gamepad."""

from __future__ import annotations

from metaros.drivers.joystick.teleop import Teleop


def teleop() -> Teleop:
    return Teleop(deadman=1, linear_axis=1, angular_axis=0, max_linear=0.5, max_angular=2.0)


def test_nothing_is_sent_without_the_deadman_button() -> None:
    assert teleop().speeds([1.0, 1.0], [1, 0]) is None


def test_axes_are_speeds_while_it_is_held_and_one_zero_ends_it() -> None:
    made = teleop()
    assert made.speeds([-0.5, 1.0], [0, 1]) == (0.5, -1.0)
    assert made.speeds([0.0, 0.0], [0, 1]) == (0.0, 0.0)
    assert made.speeds([1.0, 1.0], [0, 0]) == (0.0, 0.0)
    assert made.speeds([1.0, 1.0], [0, 0]) is None


def test_a_gamepad_that_goes_while_driving_gives_one_zero() -> None:
    made = teleop()
    assert made.release() is None
    made.speeds([1.0, 1.0], [0, 1])
    assert made.release() == (0.0, 0.0)
    assert made.release() is None


def test_buttons_and_axes_that_it_does_not_have_are_nothing() -> None:
    assert teleop().speeds([], [0, 1]) == (0.0, 0.0)
    assert teleop().speeds([1.0, 1.0], [1]) is None
