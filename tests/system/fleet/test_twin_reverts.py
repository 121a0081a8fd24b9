"""A desired state that kills the link reverts by itself: real programs, and a link that nobody mends.

Of topics it is shown by `tests/edge_agent/twin/test_agent.py`, of the agent's version by `test_update_rollout.py`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator

import pytest

from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.processes.stack import Stack
from tests.support.robots.weak_link import WeakLink
from tests.support.waiting import wait_until
from tests.system.fleet.test_twin import Robot

ROOM = 90_000  # bytes a second that the link carries
SAFE, LOAD = 20_000, 200_000  # bytes a second: a budget, and what a topic would send without one
JAMMER = "import socket, sys; socket.create_connection(('127.0.0.1', int(sys.argv[1]))).recv(1)"

pytestmark = [pytest.mark.integration, pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")]


@pytest.fixture(scope="module")
def robot(shared_gateway: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    folder = tmp_path_factory.mktemp("robot")
    with shared_gateway.beside(folder) as stack, WeakLink(stack.grpc_port, most_bytes=ROOM) as link:
        stack.router()
        command = json.dumps([sys.executable, "-S", "-c", JAMMER, str(link.jam_port)])
        (folder / "agent.toml").write_text(f'[[allowed]]\nname = "radio"\ncommand = {command}\n')
        try:
            yield Robot(stack, link, "--config", str(folder / "agent.toml"), name="weak")
        finally:
            if running_pid(folder / "agent") is not None:
                ask(folder / "agent", "shutdown")  # so that the agent, which still lives, starts none
                wait_until(lambda: running_pid(folder / "agent") is None)


def comes_back(robot: Robot, tried: int, before: int) -> None:
    """The robot lives by what it had before, says so over its link, and is not asked again."""
    wait_until(lambda: robot.said.get("revision") == tried and robot.said["state"] == "reverted", timeout_s=180)
    found = robot.twin
    assert (found["revision"], found["in_step"]) == (tried, False)
    assert (found["reported"]["applied"], found["reported"]["code"]) == (before, "not_confirmed")
    assert robot.kept()["applied"]["revision"] == before
    assert robot.kept()["pending"] is None


def test_a_budget_that_floods_the_link(robot: Robot) -> None:
    assert isinstance(robot.proxy, WeakLink)
    text = "{data: " + "x" * (LOAD // 20) + "}"
    noise = ("topic", "pub", "/sim_1/noise", "std_msgs/msg/String", text, "--rate", "20", "--quiet")
    program = robot.stack.start("noise", *noise, ready=False)
    safe = {"topics": {"noise": {"class": "bulk", "rate_hz": 0}}, "budget": {"bytes_per_s": SAFE}}
    before = int(robot.ask("PUT", "", safe)["revision"])
    wait_until(lambda: robot.twin["in_step"], timeout_s=180)
    assert robot.proxy.floods == 0
    tried = robot.desire(0, window_s=5)  # the robot asks to keep it a quarter of that after it lives by it
    wait_until(lambda: robot.proxy.floods > 0, timeout_s=120)
    comes_back(robot, tried, before)
    assert robot.budget() == SAFE
    program.kill()


def test_a_node_that_takes_the_radio_for_itself(robot: Robot) -> None:
    assert isinstance(robot.proxy, WeakLink)
    before = robot.desire(SAFE)
    wait_until(lambda: robot.twin["in_step"], timeout_s=120)
    patch = {"nodes": {"radio": {"allowed": "radio"}}}
    # A quarter of it is what the program has to get to the radio: else the robot keeps it, as it may.
    tried = int(robot.ask("PATCH", "?confirm_within_s=8", patch)["revision"])
    wait_until(lambda: robot.proxy.jams > 0, timeout_s=120)
    comes_back(robot, tried, before)
    assert robot.said["values"]["nodes"] == {}
    again = robot.desire(2 * SAFE)
    assert again > tried
    robot.ask("PATCH", "", {"nodes": None})
    wait_until(lambda: robot.twin["in_step"], timeout_s=180)
    assert robot.budget() == 2 * SAFE
