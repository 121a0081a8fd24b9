"""Parameters of simulated robots: what they do to the robot, and that the command line sets them."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

import metaros
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.sim import run_sim
from metaros.sim.fleet import RATE_HZ, Fleet
from metaros.sim.node import PARAMETERS
from tests.support.processes.command_line import run_metaros
from tests.support.processes.fast_loop import HurriedClock
from tests.support.waiting import wait_until


def test_no_driver_is_faster_than_max_speed():
    fleet = Fleet(robots=1, seed=3)
    robot = fleet.robot("sim_1")
    robot.max_speed_m_s = 0.2
    speeds = []
    for tick in range(20 * RATE_HZ):
        if tick > 10 * RATE_HZ:
            robot.command(-1.0, 0.0, now_s=tick / RATE_HZ)
        fleet.step()
        speeds.append(abs(robot.body.linear_m_s))
    assert 0.19 < max(speeds) <= 0.2 + 1e-9


def test_drain_scan_rate_and_resume_time_can_be_changed():
    plain, changed = Fleet(robots=1, seed=3), Fleet(robots=1, seed=3)
    robot = changed.robot("sim_1")
    robot.drain_per_s, robot.scan_rate_hz, robot.gate.resume_after_s = 0.01, 2.0, 1.0
    robot.command(0.1, 0.0, now_s=0.0)
    scans = 0
    for _ in range(10 * RATE_HZ):
        plain.step()
        changed.step()
        scans += robot.scanned
    assert scans == 20
    lost = plain.robot("sim_1").body.battery.charge - robot.body.battery.charge
    assert lost == pytest.approx(0.1, abs=0.01)
    assert any("resumed autonomy after 1 s" in event.text for event in robot.events)


@pytest.fixture
def sim(zenoh_router: str) -> Iterator[None]:
    stop = threading.Event()
    with metaros.Context(connect=zenoh_router, clock=HurriedClock(speed=5.0)) as context:
        options = {"robots": 1, "context": context, "camera": False, "stop": stop, "resume_after_s": 7.0}
        thread = threading.Thread(target=run_sim, kwargs=options)
        thread.start()
        yield
        stop.set()
        thread.join()


@pytest.mark.usefixtures("sim")
def test_the_command_line_slows_a_robot_down(zenoh_router):
    speeds: list[float] = []
    with metaros.Context(connect=zenoh_router) as context, metaros.Node("observer", context=context) as node:
        node.create_subscription(Odometry, "/sim_1/odom", lambda m: speeds.append(abs(m.twist.twist.linear.x)), 10)
        client = node.create_parameter_client("/sim_1/base")
        assert client.wait()
        assert client.list() == ["use_sim_time", *(parameter.name for parameter in PARAMETERS)]
        assert client.get(["max_speed", "resume_after_s"]) == {"max_speed": 1.0, "resume_after_s": 7.0}
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        wait_until(lambda: executor.spin_once(0.1) and max(speeds, default=0.0) > 0.3)
        port = zenoh_router.rsplit(":", 1)[1]
        reported = run_metaros("param", "set", "/sim_1/base", "max_speed", "0.2", "--zenoh-port", port)
        assert reported == "Set parameter successful\n"
        wait_until(lambda: executor.spin_once(0.1) and speeds[-1] < 0.25)
        speeds.clear()
        wait_until(lambda: executor.spin_once(0.1) and len(speeds) > 40)
        assert max(speeds) < 0.25
        refused = client.set({"max_speed": 3.0})["max_speed"]
        assert refused.reason == "max_speed: 3.0 is not within 0.0..1.0"
