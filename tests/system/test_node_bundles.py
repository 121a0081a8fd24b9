"""A node from a signed bundle, end to end: published, named by the twin, run in its own environment, taken back."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from metaros.errors import UnavailableError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.stack import Stack
from tests.support.tuf_repository import make_bundle, make_wheel
from tests.support.waiting import wait_until
from tests.system.test_update_rollout import Desk, sign_and_publish

WITHIN_S = 240.0
ROBOT, NAME = "arm_1", "lidar-node"
SETTINGS = "[nodes]\nhealth_s = 1.0\n[black_box]\nenabled = false\n"
GOOD = """
import sys, threading
import lidar_words
def main():
    print("runs", lidar_words.VERSION, "in", sys.prefix, *sys.argv[1:], flush=True)
    threading.Event().wait(3600)
"""
BAD = "def main():\n    raise SystemExit('no lidar')\n"

pytestmark = [
    pytest.mark.integration,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform == "win32", reason="ends the supervisor as POSIX does"),
]


def bundle(folder: Path, version: str, code: str, **rows: Any) -> Path:
    """The file of a version; what it runs is in one wheel, what that needs in another."""
    wheels = dict(
        [
            make_wheel("lidar_node", version, {"lidar_node.py": code}),
            make_wheel("lidar_words", version, {"lidar_words.py": f"VERSION = {version!r}\n"}),
        ]
    )
    path = folder / f"{NAME}-{version}.zip"
    path.write_bytes(make_bundle(version, name=NAME, kind="node", wheels=wheels, entry="lidar_node:main", **rows))
    return path


class Robot:
    """The robot as its twin and its supervisor tell of it."""

    def __init__(self, stack: Stack, metaros: Desk) -> None:
        self.state, self._metaros, self._path = stack.folder / "robot", metaros, stack.folder / "twin.json"

    def want(self, version: str) -> None:
        """The node in that version."""
        row = {"bundle": NAME, "version": version, "args": ["--fast"]}
        self._path.write_text(json.dumps({"nodes": {"lidar": row}}))
        self._metaros(f"twin set {ROBOT} {self._path}")

    def node(self) -> dict[str, Any]:
        """As the gateway has it reported."""
        found = (self._metaros.json(f"twin show {ROBOT}")["reported"] or {}).get("values", {})
        return dict(found.get("nodes", {}).get("lidar", {}))

    def until(self, version: str, state: str) -> dict[str, Any]:
        """That version has come to this state; the node then."""
        wanted = (version, state)
        wait_until(lambda: told(self.node()) == wanted, timeout_s=WITHIN_S, every_s=0.5)
        wait_until(lambda: self.node().get("state") == "running", timeout_s=WITHIN_S, every_s=0.5)
        return self.node()


def told(node: dict[str, Any]) -> tuple[str, str]:
    """What is said of its update."""
    update = node.get("update", {})
    return update.get("version", ""), update.get("state", "")


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


def test_a_node_runs_from_its_bundle_and_a_broken_version_is_taken_back(
    stack: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    metaros, robot = Desk(stack), Robot(stack, Desk(stack))
    stack.router()
    stack.gateway()
    (tmp_path / "agent.toml").write_text(SETTINGS)
    token = metaros.json(f"robot token --robot {ROBOT}")["token"]
    metaros(f"agent enrol {token} --name {ROBOT} --state-dir {robot.state}")
    where = ("--zenoh-port", str(stack.zenoh_port), "--zenoh-profile", "open", "--state-dir", str(robot.state))
    options = ("--name", ROBOT, "--namespace", f"/{ROBOT}", "--no-host-metrics", *where)
    stack.start("agent", "agent", *options, "--config", str(tmp_path / "agent.toml"))
    versions = [
        bundle(tmp_path, "1.0.0", GOOD),
        bundle(tmp_path, "1.1.0", BAD),
        bundle(tmp_path, "1.2.0", GOOD, min_version="1.2.0"),
    ]
    sign_and_publish(metaros, tmp_path / "updates", versions)
    wait_until(lambda: ROBOT in stack.online(), timeout_s=WITHIN_S)

    robot.want("1.0.0")
    first = robot.until("1.0.0", "healthy")
    venv = robot.state / "bundles" / NAME / "1.0.0" / "venv"
    assert Path(psutil.Process(first["pid"]).cmdline()[0]).parent.parent == venv
    log = ask(robot.state, "log", node="lidar", backwards=True)["lines"]
    words = f"runs 1.0.0 in {venv} --fast --ros-args -r __node:=lidar -r __ns:=/{ROBOT}"
    assert words in [line["text"] for line in log]

    robot.want("1.1.0")
    back = robot.until("1.1.0", "rolled_back")
    assert back["version"] == "1.0.0"
    assert back["update"]["code"] == "node_unhealthy"
    assert "exit code 1" in back["update"]["message"]
    crash = ask(robot.state, "crashes", node="lidar")["crashes"][-1]
    assert (crash["version"], crash["lines"]) == ("1.1.0", ["no lidar"])

    robot.want("1.2.0")
    assert robot.until("1.2.0", "healthy")["version"] == "1.2.0"
    robot.want("1.0.0")  # below the floor that 1.2.0 brought when it had proved itself
    refused = robot.until("1.0.0", "refused")
    assert (refused["version"], refused["update"]["code"]) == ("1.2.0", "update_floor")
    with pytest.raises(UnavailableError):
        ask(robot.state, "crashes", node="nobody")
