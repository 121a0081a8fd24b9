"""Containers as nodes: of a signed image, run by the robot's engine, gone when their node or its supervisor is."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from edge_agent.config.node_settings import NodeSettings
from edge_agent.nodes.errors import NodeRefusedError
from edge_agent.nodes.launch_row import LaunchContext, as_json, launch_row
from edge_agent.update import nodes as nodes_module
from edge_agent.update.errors import UpdateForeignError, UpdateInstallError
from edge_agent.update.nodes import NodeBundles
from metaros.errors import UnavailableError
from metaros.fleet.twin import parse
from metaros.fleet.twin.document import NodeSpec
from metaros.limits import LIMITS
from metaros.supervise.client import ask
from metaros.supervise.node_table_file import Row, TableFile, read_rows
from tests.support.nodes.fake_engine import FakeEngine
from tests.support.processes.processes import alive, started
from tests.support.robots.tuf_robot import TufRobot, tuf_robot
from tests.support.servers.tuf_repository import make_bundle
from tests.support.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the engine that is played here is Linux's")
CODE = """
import os, signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
print("inside", os.getpid(), *sys.argv[1:], flush=True)
signal.sigwait([signal.SIGINT])
"""
PLACE = LaunchContext(namespace="/r1", zenoh_port=7447, env={"ZENOH_SESSION_CONFIG_URI": "/z/node.json5"})


@dataclass
class Image:
    folder: Path
    engine: str
    image: str
    argv: tuple[str, ...] = ()


def wanted(**values: Any) -> NodeSpec:
    nodes = parse({"nodes": {"lidar": {"bundle": "lidar", "version": "1.0", **values}}}).nodes
    assert nodes is not None
    return nodes["lidar"]


@pytest.fixture
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeEngine]:
    found = FakeEngine(tmp_path / "engine")
    monkeypatch.setenv("PATH", found.path)
    yield found
    for pid in found.containers().values():  # of a test that failed
        os.kill(pid, signal.SIGKILL)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[TufRobot]:
    with tuf_robot(tmp_path) as (robot, repository, _):
        for version, code in (("1.0", CODE), ("2.0", "broken")):
            more = {"files/image.tar": code.encode()}
            data = make_bundle(version, name="lidar", kind="node", wheels={}, more=more, image="files/image.tar")
            repository.add(f"nodes/lidar/{version}.zip", data)
        repository.publish()
        yield robot


def bundles(robot: TufRobot) -> NodeBundles:
    return NodeBundles(robot.state_dir, lambda: robot.source)


async def test_an_image_goes_to_the_engine_and_is_known_by_its_id(
    robot: TufRobot, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = await bundles(robot).get("lidar", "1.0")
    assert (found.argv, found.engine) == ((), str(engine.program))
    assert found.image.startswith("sha256:")
    assert json.loads((found.folder / "bundle.json").read_text())["kind"] == "container"
    with pytest.raises(UpdateInstallError, match="refuses to load: no image"):
        await bundles(robot).get("lidar", "2.0")
    monkeypatch.setattr(nodes_module, "LIMITS", replace(LIMITS, node_bundles=0))
    assert ("lidar", "1.0") in bundles(robot).collect([])
    assert engine.images() == 0


async def test_without_an_engine_it_says_so(robot: TufRobot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UpdateForeignError, match="no engine: podman or docker"):
        await bundles(robot).get("lidar", "1.0")
    assert bundles(robot).ready("lidar", "1.0") is None


def test_a_row_says_nothing_secret_and_is_in_the_robots_network(tmp_path: Path) -> None:
    image = Image(tmp_path / "bundles" / "lidar" / "1.0", "/bin/podman", "sha256:1")
    row = launch_row(wanted(args=["--fast"], parameters={"rate_hz": 5}), NodeSettings(), PLACE, image)
    assert read_rows([as_json(row)]) == (row,)
    assert row.argv[:4] == ("/bin/podman", "run", "--rm", "--name")
    assert row.clean_up == ("/bin/podman", "rm", "--force", row.argv[4])
    assert row.argv[-7:] == ("sha256:1", "--fast", "--ros-args", "-r", "__ns:=/r1", "-p", "rate_hz:=5")
    words = " ".join(row.argv)
    assert "--network host" in words
    assert "--env METAROS_ZENOH_PORT " in words
    assert "--volume /z/node.json5:/z/node.json5:ro" in words
    remote = Image(tmp_path / "other" / "bundles" / "lidar" / "1.0", "/bin/podman", "sha256:1")
    assert launch_row(wanted(), NodeSettings(), PLACE, remote).argv[4] != row.argv[4]
    with pytest.raises(NodeRefusedError, match="cannot be migratable"):
        launch_row(wanted(migratable=True), NodeSettings(), PLACE, image)


class Robot:
    """A supervisor in a process of its own."""

    def __init__(self, folder: Path, row: Row) -> None:
        self.folder = folder
        self.argv = [sys.executable, "-m", "metaros", "supervisor", "--detached", "--state-dir", str(folder)]
        TableFile(folder / "supervisor.json").replace(read_rows([as_json(row)]), frozenset(), tag="")

    def pid(self) -> int:
        """Of the engine's program; 0 while there is none."""
        try:
            return int(ask(self.folder, "list")["nodes"][0]["pid"] or 0)
        except UnavailableError:  # it is just starting
            return 0

    def log(self) -> str:
        """What the node has said."""
        path = self.folder / "logs" / "lidar.log"
        return path.read_text() if path.exists() else ""

    def container(self, engine: FakeEngine) -> int:
        """The process of the one container, once it runs and may be asked to end."""
        wait_until(lambda: len(engine.containers()) == 1)
        pid = next(iter(engine.containers().values()))
        wait_until(lambda: f"inside {pid} " in self.log() and self.pid() > 0)
        return pid


@pytest.mark.integration
async def test_it_ends_with_its_node_and_with_a_killed_supervisor(robot: TufRobot, engine: FakeEngine) -> None:
    row = launch_row(wanted(args=["--fast"]), NodeSettings(), PLACE, await bundles(robot).get("lidar", "1.0"))
    await asyncio.to_thread(the_life_of_a_container, Robot(robot.state_dir, row), engine)


def the_life_of_a_container(robot: Robot, engine: FakeEngine) -> None:
    with started(robot.argv) as process:
        first = robot.container(engine)
        ask(robot.folder, "stop", node="lidar")
        assert engine.containers() == {}
        assert not alive(first)
        ask(robot.folder, "start", node="lidar")
        second = robot.container(engine)
        os.kill(robot.pid(), signal.SIGKILL)  # whose container goes on without it, were it not taken away
        wait_until(lambda: not alive(second))
        third = robot.container(engine)
        process.kill()
        wait_until(lambda: not alive(third))
    with started(robot.argv):
        fourth = robot.container(engine)
        ask(robot.folder, "shutdown")
        wait_until(lambda: not alive(fourth))
    assert f"inside {fourth} --fast" in robot.log()
    assert "in use" not in robot.log()
