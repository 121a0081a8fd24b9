"""Docking: the way to a pad, charging, and whoever ends it."""

from __future__ import annotations

import math

import pytest

from metaros.sim.command_gate import Mode
from metaros.sim.docking import CHARGE_PER_S, PAD_M, PADS, Docking, steps_between
from metaros.sim.fleet import STEP_S, Fleet
from metaros.sim.warehouse import CROSSINGS, NEIGHBOURS


def test_robots_find_the_nearest_pad_charge_and_drive_on() -> None:
    fleet = Fleet(robots=4, seed=3)
    begun, full = {}, {}
    for robot in fleet.robots:
        robot.body.battery.charge = 0.7
        said, line = robot.seek_dock()
        assert said
        assert "on the way" in line
        assert robot.dock.pad == min(PADS, key=lambda pad: math.dist(CROSSINGS[pad], (robot.body.x, robot.body.y)))
    while len(full) < 4:
        assert fleet.tick < 60 / STEP_S
        before = {robot: (robot.dock.docking, robot.body.battery.charge) for robot in fleet.robots}
        fleet.step()
        for robot, (docking, charge) in before.items():
            body = robot.body
            if docking is Docking.CHARGING:
                assert begun.setdefault(robot, fleet.tick) > 0
                if fleet.tick - begun[robot] > 10:
                    assert body.linear_m_s == 0.0
                if robot.dock.docking is Docking.CHARGING:
                    assert body.battery.charge - charge == pytest.approx(CHARGE_PER_S * STEP_S, rel=0.05)
                    assert body.battery.current_a < 0.0
                else:
                    assert body.battery.charge == pytest.approx(1.0, abs=1e-3)
                    full[robot] = (fleet.tick, body.x, body.y)
            elif robot.dock.docking is Docking.CHARGING:
                assert math.dist(CROSSINGS[robot.dock.pad], (body.x, body.y)) < PAD_M
    assert all(10.0 < (full[robot][0] - begun[robot]) * STEP_S < 20.0 for robot in fleet.robots)
    for _ in range(round(10 / STEP_S)):
        fleet.step()
    assert all(math.dist(here, (robot.body.x, robot.body.y)) > 1.0 for robot, (_, *here) in full.items())


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
