"""A function as a signed bundle, end to end: published, named by the twin, run by the supervisor beside the agent."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

import metaros
from metaros.interfaces.std_msgs.msg import String
from metaros.robot_functions.bundle import make_bundle
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.robot_function import write_function
from tests.support.stack import Stack
from tests.support.waiting import wait_until
from tests.system.test_node_bundles import Robot
from tests.system.test_update_rollout import Desk, sign_and_publish

WITHIN_S = 240.0
ROBOT, NAME = "arm_1", "echo"
SETTINGS = "[nodes]\nhealth_s = 1.0\n[black_box]\nenabled = false\n"
SAY = """
def handler(event, context):
    said = event["detail"]["message"]["data"]
    return {"publish": [
        {"topic": "answer", "type": "std_msgs/msg/String", "message": {"data": f"VERSION {said}"}},
        *([{"topic": "cmd_vel", "type": "geometry_msgs/msg/Twist"}] if said == "drive" else []),
    ]}
"""

pytestmark = [
    pytest.mark.integration,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform == "win32", reason="ends the supervisor as POSIX does"),
]


class Function(Robot):
    """The robot, and what its twin says of the function."""

    def want(self, version: str) -> None:
        """The function in that version."""
        self._path.write_text(json.dumps({"nodes": {"lidar": {"bundle": NAME, "version": version}}}))
        self._metaros(f"twin set {ROBOT} {self._path}")


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    state = tmp_path / "robot"
    with Stack(tmp_path) as stack:
        try:
            yield stack
        finally:
            if running_pid(state) is not None:
                ask(state, "shutdown")  # so that the agent, which still lives, starts none
                wait_until(lambda: running_pid(state) is None)


def bundle(folder: Path, version: str) -> Path:
    """The function in that version."""
    package = write_function(folder / version, SAY.replace("VERSION", version))
    return make_bundle(package, folder / f"{NAME}-{version}.zip", version=version)


def test_a_function_runs_from_its_signed_bundle_through_versions_and_crashes(
    stack: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    desk, robot = Desk(stack), Function(stack, Desk(stack))
    stack.router()
    stack.gateway()
    (tmp_path / "agent.toml").write_text(SETTINGS)
    token = desk.json(f"robot token --robot {ROBOT}")["token"]
    desk(f"agent enrol {token} --name {ROBOT} --state-dir {robot.state}")
    where = ("--zenoh-port", str(stack.zenoh_port), "--zenoh-profile", "open", "--state-dir", str(robot.state))
    options = ("--name", ROBOT, "--namespace", f"/{ROBOT}", "--no-host-metrics", *where)
    stack.start("agent", "agent", *options, "--config", str(tmp_path / "agent.toml"))
    sign_and_publish(desk, tmp_path / "updates", [bundle(tmp_path, "1.0.0"), bundle(tmp_path, "1.1.0")])
    wait_until(lambda: ROBOT in stack.online(), timeout_s=WITHIN_S)

    robot.want("9.0.0")  # nobody signed any 9.0.0
    wait_until(lambda: robot.node().get("update", {}).get("state") in ("refused", "failed"), timeout_s=WITHIN_S)
    assert robot.node().get("state") != "running"

    answers: list[str] = []
    with metaros.Context(connect=f"tcp/127.0.0.1:{stack.zenoh_port}") as context:
        node = metaros.Node("base", namespace=f"/{ROBOT}", context=context)
        words = node.create_publisher(String, "word")
        node.create_subscription(String, "answer", lambda message: answers.append(message.data), dedicated=True)

        def lives() -> set[str]:
            """The sessions that listen: of one that was killed the graph knows for a moment longer."""
            ends = node.graph.endpoints(f"/{ROBOT}/word", "MS")
            return {end.zid for end in ends if end.node_full_name == f"/{ROBOT}/lidar"}

        def say(text: str, old: frozenset[str] = frozenset()) -> None:
            wait_until(lambda: lives() - old, timeout_s=WITHIN_S)
            words.publish(String(data=text))

        for version in ("1.0.0", "1.1.0"):
            robot.want(version)
            running = robot.until(version, "healthy")
            say("hello")
            wait_until(lambda version=version: f"{version} hello" in answers, timeout_s=WITHIN_S)
        assert (robot.state / "functions" / NAME / "backlog.sqlite3").is_file()

        old = frozenset(lives())
        psutil.Process(running["pid"]).kill()
        wait_until(lambda: robot.node().get("pid") not in (None, running["pid"]), timeout_s=WITHIN_S)
        say("again", old)
        wait_until(lambda: "1.1.0 again" in answers, timeout_s=WITHIN_S)
        say("drive")  # what moves the robot is refused, and nothing else of that answer is done

        def calls() -> list[dict[str, Any]]:
            found = stack.get(f"/api/v1/functions/{NAME}/invocations?kind=robot")
            return list(found["invocations"]) if found else []

        wait_until(lambda: len(calls()) >= 4, timeout_s=WITHIN_S)
        assert "1.1.0 drive" not in answers
    refused = [call for call in calls() if call["error_type"] == "action_refused"]
    assert len(refused) == 1
    assert refused[0]["robot"] == ROBOT
    assert {call["version"] for call in calls()} == {"1.0.0", "1.1.0"}
