"""Docking: the way to a pad, charging, and whoever ends it."""

from __future__ import annotations

import math

import pytest

from metaros.sim.dock import CHARGE_PER_S, PAD_M, PADS, Docking, steps_between
from metaros.sim.fleet import STEP_S, Fleet, SimRobot
from metaros.sim.gate import Mode
from metaros.sim.warehouse import CROSSINGS, NEIGHBOURS


def until(fleet: Fleet, robot: SimRobot, docking: Docking, *, within_s: float) -> float:
    begin = fleet.tick
    while robot.dock.docking is not docking:
        assert fleet.tick < begin + within_s / STEP_S, f"{robot.dock.docking} after {within_s} s"
        fleet.step()
    return (fleet.tick - begin) * STEP_S


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_robot_finds_the_pad_charges_and_drives_on(seed: int) -> None:
    fleet = Fleet(robots=4, seed=seed)
    robot = fleet.robots[seed % 4]
    robot.body.battery.charge = 0.12
    said, line = robot.seek_dock()
    assert said
    assert "on the way" in line
    until(fleet, robot, Docking.CHARGING, within_s=240.0)
    pad = CROSSINGS[robot.dock.pad]
    assert math.dist(pad, (robot.body.x, robot.body.y)) < PAD_M
    charge = robot.body.battery.charge
    for _ in range(50):
        fleet.step()
    assert robot.body.linear_m_s == 0.0
    assert robot.body.battery.charge == pytest.approx(charge + CHARGE_PER_S, abs=1e-3)
    assert robot.body.battery.current_a < 0.0
    assert until(fleet, robot, Docking.AWAY, within_s=60.0) > 10.0
    assert robot.body.battery.charge == pytest.approx(1.0, abs=1e-3)
    here = (robot.body.x, robot.body.y)
    for _ in range(round(20 / STEP_S)):
        fleet.step()
    assert math.dist(here, (robot.body.x, robot.body.y)) > 1.0


def test_whoever_takes_over_ends_it() -> None:
    fleet = Fleet(robots=1, seed=3)
    (robot,) = fleet.robots
    robot.seek_dock()
    robot.command(0.2, 0.0, now_s=0.0)
    assert robot.dock.docking is Docking.AWAY
    assert robot.seek_dock() == (False, "cmd_vel is driving the robot; stop sending commands first")
    fleet.step(now_s=1.0)
    assert robot.gate.mode is Mode.STANDING
    assert robot.seek_dock()[0]
    assert robot.gate.mode is Mode.AUTONOMOUS
    assert robot.seek_dock() == (True, "the robot is seeking already")
    robot.resume()
    assert robot.dock.docking is Docking.AWAY


def test_every_street_is_one_step() -> None:
    assert all(steps_between(node, other) == 1 for node, others in enumerate(NEIGHBOURS) for other in others)
    assert len(set(PADS)) == 4
    assert all(len(NEIGHBOURS[pad]) == 2 for pad in PADS)
