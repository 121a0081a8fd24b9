"""Nodes and functions from signed bundles, end to end: published, named by the twin, run on the robot, taken back."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

import metaros
from metaros.automation.robot.bundle import make_bundle as function_bundle
from metaros.errors import UnavailableError
from metaros.interfaces.std_msgs.msg import String
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.functions.robot_function import write_function
from tests.support.processes.stack import Stack
from tests.support.servers.tuf_repository import make_bundle, make_wheel
from tests.support.waiting import wait_until
from tests.system.fleet.test_update_rollout import CommandLine, sign_and_publish

WITHIN_S = 240.0
ROBOT, NODE, FUNCTION = "arm_1", "lidar-node", "echo"
NAMES = {NODE: "lidar", FUNCTION: "echoes"}
SETTINGS = "[nodes]\nhealth_s = 1.0\n[black_box]\nenabled = false\n"
GOOD = """
import sys, threading
import lidar_words
def main():
    print("runs", lidar_words.VERSION, "in", sys.prefix, *sys.argv[1:], flush=True)
    threading.Event().wait(3600)
"""
BAD = "def main():\n    raise SystemExit('no lidar')\n"
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


def node_of(folder: Path, version: str, code: str, **rows: Any) -> Path:
    """The file of a version; what it runs is in one wheel, what that needs in another."""
    wheels = dict(
        [
            make_wheel("lidar_node", version, {"lidar_node.py": code}),
            make_wheel("lidar_words", version, {"lidar_words.py": f"VERSION = {version!r}\n"}),
        ]
    )
    path = folder / f"{NODE}-{version}.zip"
    path.write_bytes(make_bundle(version, name=NODE, kind="node", wheels=wheels, entry="lidar_node:main", **rows))
    return path


def function_of(folder: Path, version: str) -> Path:
    """The function in that version."""
    package = write_function(folder / version, SAY.replace("VERSION", version))
    return function_bundle(package, folder / f"{FUNCTION}-{version}.zip", version=version)


class Robot:
    """The robot as its twin and its supervisor tell of it."""

    def __init__(self, stack: Stack, metaros: CommandLine) -> None:
        self.stack, self.state = stack, stack.folder / "robot"
        self.name = ""
        self._metaros, self._path = metaros, stack.folder / "twin.json"

    def want(self, bundle: str, version: str, **more: Any) -> None:
        """The node of that bundle, and no other."""
        self.name = NAMES[bundle]
        row = {"bundle": bundle, "version": version, **more}
        self._path.write_text(json.dumps({"nodes": {self.name: row}}))
        self._metaros(f"twin set {ROBOT} {self._path}")

    def node(self) -> dict[str, Any]:
        """The one that is wanted, as the gateway has it reported."""
        found = (self.stack.get(f"/api/v1/robots/{ROBOT}/twin")["reported"] or {}).get("values", {})
        return dict(found.get("nodes", {}).get(self.name, {}))

    def until(self, version: str, state: str) -> dict[str, Any]:
        """That version has come to this state; the node then."""
        wanted = (version, state)
        wait_until(lambda: reported(self.node()) == wanted, timeout_s=WITHIN_S, every_s=0.05)
        wait_until(lambda: self.node().get("state") == "running", timeout_s=WITHIN_S, every_s=0.05)
        return self.node()


def reported(node: dict[str, Any]) -> tuple[str, str]:
    """What is said of its update."""
    update = node.get("update", {})
    return update.get("version", ""), update.get("state", "")


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    """An enrolled robot, and a gateway to which versions of a node and of a function were published."""
    folder = tmp_path_factory.mktemp("bundles")
    with pytest.MonkeyPatch.context() as monkeypatch, Stack(folder) as stack:
        monkeypatch.setenv("HOME", str(folder))
        metaros = CommandLine(stack)
        robot = Robot(stack, metaros)
        stack.router()
        stack.gateway()
        (folder / "agent.toml").write_text(SETTINGS)
        token = metaros.json(f"robot token --robot {ROBOT}")["token"]
        metaros(f"agent enrol {token} --name {ROBOT} --state-dir {robot.state}")
        where = ("--zenoh-port", str(stack.zenoh_port), "--zenoh-profile", "open", "--state-dir", str(robot.state))
        options = ("--name", ROBOT, "--namespace", f"/{ROBOT}", "--no-host-metrics", *where)
        stack.start("agent", "agent", *options, "--config", str(folder / "agent.toml"))
        nodes = [
            node_of(folder, "1.0.0", GOOD),
            node_of(folder, "1.1.0", BAD),
            node_of(folder, "1.2.0", GOOD, min_version="1.2.0"),
        ]
        functions = [function_of(folder, version) for version in ("1.0.0", "1.1.0")]
        sign_and_publish(metaros, folder / "updates", [*nodes, *functions])
        wait_until(lambda: ROBOT in stack.online(), timeout_s=WITHIN_S)
        try:
            yield robot
        finally:
            if running_pid(robot.state) is not None:
                ask(robot.state, "shutdown")  # so that the agent, which still lives, starts none
                wait_until(lambda: running_pid(robot.state) is None)


def test_a_node_runs_from_its_bundle_and_a_broken_version_is_taken_back(robot: Robot) -> None:
    robot.want(NODE, "1.0.0", args=["--fast"])
    first = robot.until("1.0.0", "healthy")
    venv = robot.state / "bundles" / NODE / "1.0.0" / "venv"
    assert Path(psutil.Process(first["pid"]).cmdline()[0]).parent.parent == venv
    log = ask(robot.state, "log", node="lidar", backwards=True)["lines"]
    words = f"runs 1.0.0 in {venv} --fast --ros-args -r __node:=lidar -r __ns:=/{ROBOT}"
    assert words in [line["text"] for line in log]

    robot.want(NODE, "1.1.0", args=["--fast"])
    back = robot.until("1.1.0", "rolled_back")
    assert back["version"] == "1.0.0"
    assert back["update"]["code"] == "node_unhealthy"
    assert "exit code 1" in back["update"]["message"]
    crash = ask(robot.state, "crashes", node="lidar")["crashes"][-1]
    assert (crash["version"], crash["lines"]) == ("1.1.0", ["no lidar"])

    robot.want(NODE, "1.2.0", args=["--fast"])
    assert robot.until("1.2.0", "healthy")["version"] == "1.2.0"
    robot.want(NODE, "1.0.0", args=["--fast"])  # below the floor that 1.2.0 brought when it had proved itself
    refused = robot.until("1.0.0", "refused")
    assert (refused["version"], refused["update"]["code"]) == ("1.2.0", "update_floor")
    with pytest.raises(UnavailableError):
        ask(robot.state, "crashes", node="nobody")


def test_a_function_runs_from_its_bundle_through_versions_and_crashes(robot: Robot) -> None:
    robot.want(FUNCTION, "9.0.0")  # nobody signed any 9.0.0
    wait_until(lambda: reported(robot.node()) in (("9.0.0", "refused"), ("9.0.0", "failed")), timeout_s=WITHIN_S)
    assert robot.node().get("state") != "running"

    answers: list[str] = []
    with metaros.Context(connect=f"tcp/127.0.0.1:{robot.stack.zenoh_port}") as context:
        node = metaros.Node("base", namespace=f"/{ROBOT}", context=context)
        words = node.create_publisher(String, "word")
        node.create_subscription(String, "answer", lambda message: answers.append(message.data), dedicated=True)

        def lives() -> set[str]:
            """The sessions that listen: of one that was killed the graph knows for a moment longer."""
            ends = node.graph.endpoints(f"/{ROBOT}/word", "MS")
            return {end.zid for end in ends if end.node_full_name == f"/{ROBOT}/echoes"}

        def say(text: str, old: frozenset[str] = frozenset()) -> None:
            wait_until(lambda: lives() - old, timeout_s=WITHIN_S)
            words.publish(String(data=text))

        for version in ("1.0.0", "1.1.0"):
            robot.want(FUNCTION, version)
            running = robot.until(version, "healthy")
            say("hello")
            wait_until(lambda version=version: f"{version} hello" in answers, timeout_s=WITHIN_S)
        assert (robot.state / "functions" / FUNCTION / "backlog.sqlite3").is_file()

        old = frozenset(lives())
        psutil.Process(running["pid"]).kill()
        wait_until(lambda: robot.node().get("pid") not in (None, running["pid"]), timeout_s=WITHIN_S)
        say("again", old)
        wait_until(lambda: "1.1.0 again" in answers, timeout_s=WITHIN_S)
        say("drive")  # what moves the robot is refused, and nothing else of that answer is done

        def calls() -> list[dict[str, Any]]:
            found = robot.stack.get(f"/api/v1/functions/{FUNCTION}/invocations?kind=robot")
            return list(found["invocations"]) if found else []

        wait_until(lambda: len(calls()) >= 4, timeout_s=WITHIN_S, every_s=0.05)
        assert "1.1.0 drive" not in answers
    refused = [call for call in calls() if call["error_type"] == "action_refused"]
    assert len(refused) == 1
    assert refused[0]["robot"] == ROBOT
    assert {call["version"] for call in calls()} == {"1.0.0", "1.1.0"}
