"""The whole simulation without ROS: determinism, ten minutes without an accident, faults and who drives."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import pytest

from metaros.errors import ConfigError
from metaros.sim.command_gate import Mode
from metaros.sim.faults import parse_schedule
from metaros.sim.fleet import STEP_S, Fleet, SimRobot, due
from metaros.sim.robot import DRIVE
from metaros.sim.warehouse import WAREHOUSE


def run(fleet: Fleet, seconds: float) -> Fleet:
    for _ in range(round(seconds / STEP_S)):
        fleet.step()
    return fleet


def state(robot: SimRobot) -> tuple[object, ...]:
    body, odometry = robot.body, robot.odometry
    return (
        *(body.x, body.y, body.heading_rad, body.left_m_s, body.right_m_s, body.battery.charge),
        *(body.motor_temperature_c, odometry.x, odometry.y, odometry.heading_rad, robot.lidar.ranges.tobytes()),
        *(event.text for event in robot.events),
    )


def test_the_same_seed_gives_the_same_states() -> None:
    options = {"robots": 3, "faults": [parse_schedule("sim_2:lidar_dropout@5")]}
    first = run(Fleet(seed=7, **options), 12.0)  # type: ignore[arg-type]
    second = run(Fleet(seed=7, **options), 12.0)  # type: ignore[arg-type]
    other = run(Fleet(seed=8, **options), 1.0)  # type: ignore[arg-type]
    assert [state(robot) for robot in first.robots] == [state(robot) for robot in second.robots]
    assert [state(robot) for robot in first.robots] != [state(robot) for robot in other.robots]


@pytest.mark.integration
def test_a_crowd_waits_turns_back_creeps_and_has_no_accident() -> None:
    fleet = Fleet(robots=16, seed=5)
    way = dict.fromkeys((robot.name for robot in fleet.robots), 0.0)
    clear, apart, bumps = math.inf, math.inf, 0
    for _ in range(round(24 / STEP_S)):
        fleet.step()
        for robot in fleet.robots:
            way[robot.name] += abs(robot.body.linear_m_s) * STEP_S
            bumps += robot.body.bumped
        if fleet.tick % 5 == 0:
            places = [(robot.body.x, robot.body.y) for robot in fleet.robots]
            clear = min(clear, *(WAREHOUSE.clearance(*place) for place in places))
            apart = min(apart, *(math.dist(*pair) for pair in combinations(places, 2)))
    assert bumps == 0
    assert clear > DRIVE.radius_m
    assert apart > 2 * DRIVE.radius_m
    assert min(way.values()) > 7.0
    assert all(0.5 < robot.body.battery.charge < 0.98 for robot in fleet.robots)
    said = "".join(event.text for robot in fleet.robots for event in robot.events)
    assert all(words in said for words in ("collision avoided", "turning back", "creeping on"))


def test_a_command_takes_over_and_the_watchdog_stops_it() -> None:
    fleet = run(Fleet(robots=1, seed=1, resume_after_s=2.0), 3.0)
    robot = fleet.robots[0]
    robot.events.clear()
    for _ in range(25):
        robot.command(0.4, 0.0, now_s=fleet.tick * STEP_S)
        fleet.step()
    assert robot.gate.mode is Mode.COMMANDED
    run(fleet, 0.5)
    assert robot.gate.mode is Mode.STANDING
    place = (robot.body.x, robot.body.y)
    assert robot.body.linear_m_s == 0.0
    run(fleet, 1.5)
    assert (robot.body.x, robot.body.y) == place
    run(fleet, 5.0)
    assert robot.gate.mode is Mode.AUTONOMOUS
    assert (robot.body.x, robot.body.y) != place
    assert [event.text for event in robot.events if "obstacle" not in event.text] == [
        "taken over by cmd_vel",
        "no cmd_vel for 300 ms: stopped by the watchdog",
        "resumed autonomy after 2 s without a command",
    ]


def test_resume_at_once() -> None:
    fleet = Fleet(robots=1, seed=1, resume_after_s=1000.0)
    robot = fleet.robots[0]
    robot.command(0.1, 0.0, now_s=0.0)
    assert robot.resume()[0] is False
    run(fleet, 1.0)
    assert robot.resume() == (True, "resumed autonomy on request")
    assert robot.resume()[0] is True
    assert [event.text for event in robot.events].count("resumed autonomy on request") == 1
    run(fleet, 5.0)
    assert robot.odometry.travelled_m > 0.5


def test_a_robot_left_anywhere_finds_its_way_back() -> None:
    fleet = Fleet(robots=1, seed=1, resume_after_s=0.5)
    robot = fleet.robots[0]
    for turn in (0.0, 0.9, -0.7):
        for _ in range(500):
            robot.command(0.8, turn, now_s=fleet.tick * STEP_S)
            fleet.step()
        run(fleet, 15.0)
        before = robot.odometry.travelled_m
        run(fleet, 10.0)
        assert robot.odometry.travelled_m > before + 2.0


def test_scheduled_faults_begin_in_time() -> None:
    fleet = Fleet(robots=2, seed=1, faults=[parse_schedule("sim_2:hot_motor@2"), parse_schedule("sim_2:clear@4")])
    run(fleet, 1.9)
    assert fleet.robot("sim_2").faults == set()
    run(fleet, 0.2)
    assert fleet.robot("sim_2").faults == {"hot_motor"}
    assert fleet.robot("sim_1").faults == set()
    run(fleet, 2.0)
    assert fleet.robot("sim_2").faults == set()


def test_a_hot_motor_gets_hot() -> None:
    fleet = run(Fleet(robots=2, seed=1, faults=[parse_schedule("sim_1:hot_motor")]), 20.0)
    assert fleet.robot("sim_1").body.motor_temperature_c > fleet.robot("sim_2").body.motor_temperature_c + 15.0


def test_a_drained_battery_is_low_then_empty_then_swapped() -> None:
    fleet = Fleet(robots=1, seed=1, faults=[parse_schedule("sim_1:battery_drain")])
    robot = fleet.robots[0]
    robot.body.battery.charge = 0.2
    while robot.body.battery.charge > 0.0:
        assert fleet.tick * STEP_S < 41.0
        run(fleet, 1.0)
    run(fleet, 25.0)
    assert robot.body.battery.charge == 0.0
    assert robot.body.linear_m_s == 0.0
    robot.inject("clear")
    run(fleet, 6.0)
    assert robot.body.battery.charge > 0.99
    texts = " | ".join(event.text for event in robot.events)
    for part in (
        "fault battery_drain",
        "battery low: 15%",
        "battery empty",
        "faults cleared: battery_drain",
        "swapped",
    ):
        assert part in texts
    assert texts.count("battery low") == 1


def test_an_unknown_fault_is_an_event() -> None:
    robot = Fleet(robots=1, seed=1).robots[0]
    robot.inject("x" * 1000)
    assert robot.faults == set()
    assert "unknown fault" in robot.events[0].text
    assert len(robot.events[0].text) < 200


@pytest.mark.parametrize(
    "options",
    [
        {"robots": 0},
        {"robots": 1000},
        {"robots": 1, "resume_after_s": -1.0},
        {"robots": 1, "resume_after_s": math.nan},
        {"robots": 1, "faults": [parse_schedule("sim_9:clear")]},
    ],
)
def test_bad_settings_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        Fleet(seed=1, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("rate_hz", "most"), [(1, 1), (10, 1), (20, 1), (50, 1)])
def test_due_is_exact_and_even(rate_hz: int, most: int) -> None:
    ticks = [tick for tick in range(500) if due(rate_hz, tick)]
    assert len(ticks) == rate_hz * 10
    gaps = {b - a for a, b in pairwise(ticks)}
    assert max(gaps) - min(gaps) <= most


def test_a_slow_lidar_scans_twice_a_second_until_it_is_cleared() -> None:
    fleet = Fleet(robots=1, seed=1, faults=[parse_schedule("sim_1:lidar_slow@10"), parse_schedule("sim_1:clear@20")])
    scans = []
    for _ in range(3):
        count = 0
        for _ in range(round(10 / STEP_S)):
            fleet.step()
            count += fleet.robots[0].scanned
        scans.append(count)
    assert scans == [100, 20, 100]
