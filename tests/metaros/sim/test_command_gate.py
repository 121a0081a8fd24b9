"""Who drives: command, watchdog, resume, as a state machine under a manual clock."""

from __future__ import annotations

import math

import pytest

from metaros.clock import ManualClock
from metaros.sim.command_gate import CommandGate, Mode


def test_a_robot_begins_by_itself() -> None:
    gate = CommandGate()
    assert gate.mode is Mode.AUTONOMOUS
    assert gate.target() is None
    assert gate.poll(now_s=1e9) is None


def test_command_watchdog_and_resume_after(clock: ManualClock) -> None:
    gate = CommandGate(resume_after_s=10.0)
    assert gate.command(0.5, 0.1, now_s=clock.monotonic_s()) == "taken over by cmd_vel"
    assert gate.command(0.6, 0.1, now_s=clock.monotonic_s()) is None
    clock.advance(0.3)
    assert gate.poll(now_s=clock.monotonic_s()) is None
    assert gate.target() == (0.6, 0.1)
    clock.advance(0.01)
    line = gate.poll(now_s=clock.monotonic_s())
    assert line is not None
    assert "watchdog" in line
    assert gate.mode is Mode.STANDING
    assert gate.target() == (0.0, 0.0)
    clock.advance(9.9)
    assert gate.poll(now_s=clock.monotonic_s()) is None
    clock.advance(0.2)
    assert gate.poll(now_s=clock.monotonic_s()) == "resumed autonomy after 10 s without a command"
    assert gate.target() is None


def test_a_command_wakes_a_standing_robot(clock: ManualClock) -> None:
    gate = CommandGate()
    gate.command(0.5, 0.0, now_s=clock.monotonic_s())
    clock.advance(1.0)
    gate.poll(now_s=clock.monotonic_s())
    assert gate.command(0.2, 0.0, now_s=clock.monotonic_s()) == "taken over by cmd_vel"
    assert gate.target() == (0.2, 0.0)


def test_resume_is_refused_while_commanded_and_harmless_otherwise(clock: ManualClock) -> None:
    gate = CommandGate(resume_after_s=1000.0)
    assert gate.resume() == (True, "the robot drives itself already")
    gate.command(0.0, 0.0, now_s=clock.monotonic_s())
    done, why = gate.resume()
    assert not done
    assert "still" in why
    clock.advance(0.5)
    gate.poll(now_s=clock.monotonic_s())
    assert gate.resume() == (True, "resumed autonomy on request")
    assert gate.mode is Mode.AUTONOMOUS


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_changes_nothing(bad: float, clock: ManualClock) -> None:
    gate = CommandGate()
    gate.command(0.5, 0.0, now_s=clock.monotonic_s())
    assert gate.command(bad, 0.0, now_s=clock.monotonic_s()) is not None
    assert gate.command(0.0, bad, now_s=clock.monotonic_s()) is None
    assert gate.rejected == 2
    assert gate.target() == (0.5, 0.0)
    clock.advance(0.4)
    gate.poll(now_s=clock.monotonic_s())
    assert gate.target() == (0.0, 0.0)
