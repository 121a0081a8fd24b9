"""Bundles of nodes: fetched, checked, with an environment of their own, and cleared away."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.update import nodes as nodes_module
from edge_agent.update.errors import UpdateFloorError, UpdateForeignError, UpdateOffError
from edge_agent.update.nodes import NodeBundles
from edge_agent.update.slots import python_of
from metaros.fleet.bundle import BundleError
from metaros.limits import LIMITS
from tests.support.robots.tuf_robot import TufRobot, tuf_robot
from tests.support.servers.tuf_repository import Served, TufRepository, make_bundle, make_wheel

World = tuple[TufRobot, TufRepository, Served]
MODULE = "def main():\n    import metaros\n    print('here', metaros.__name__)\n    return 3\n"


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    with tuf_robot(tmp_path) as (robot, repository, served):
        wheels = dict([make_wheel("lidar_node", "1.2.0", {"lidar_node.py": MODULE})])
        rows = {"name": "lidar-node", "kind": "node"}
        lidar = make_bundle("1.2.0", wheels=wheels, entry="lidar_node:main", min_version="1.1.0", **rows)
        repository.add("nodes/lidar-node/1.2.0.zip", lidar)
        for version in ("1.0.0", "1.0.1", "1.0.2"):
            script = {"files/run.sh": f"#!/bin/sh\necho {version}\n".encode()}
            shell = make_bundle(
                version, name="shell", kind="node", wheels={}, more=script, command=["files/run.sh", "x"]
            )
            repository.add(f"nodes/shell/{version}.zip", shell)
        repository.publish()
        yield robot, repository, served


def bundles(robot: TufRobot) -> NodeBundles:
    return NodeBundles(robot.state_dir, lambda: robot.source)


async def output(argv: tuple[str, ...]) -> tuple[int | None, str]:
    """Exit code and output of a program."""
    process = await asyncio.create_subprocess_exec(*argv, stdout=asyncio.subprocess.PIPE)
    text, _ = await process.communicate()
    return process.returncode, text.decode()


async def test_a_python_bundle_runs_in_its_own_environment(world: World) -> None:
    robot, _, served = world
    found = await bundles(robot).get("lidar-node", "1.2.0")
    assert found.folder == robot.state_dir / "bundles" / "lidar-node" / "1.2.0"
    assert await output(found.argv) == (3, "here metaros\n")
    facts = json.loads((found.folder / "bundle.json").read_text())
    assert (facts["kind"], facts["entry"]) == ("python", "lidar_node:main")
    asked = len(served.asked)
    assert await bundles(robot).get("lidar-node", "1.2.0") == found
    assert bundles(robot).directory_of("lidar-node", "1.2.0") == found.folder
    assert len(served.asked) == asked
    assert robot.source.minimum.of("lidar-node") == ""
    bundles(robot).did_well("lidar-node", "1.2.0")
    assert robot.source.minimum.of("lidar-node") == "1.1.0"


async def test_a_command_bundle_is_as_it_is(world: World) -> None:
    robot, _, _ = world
    found = await bundles(robot).get("shell", "1.0.0")
    assert found.argv == (str(found.folder / "files" / "run.sh"), "x")
    assert await output(found.argv) == (0, "1.0.0\n")
    assert not python_of(found.folder).exists()


async def test_what_is_refused_leaves_nothing_that_counts(world: World) -> None:
    robot, repository, _ = world
    found = bundles(robot)
    repository.add("nodes/lidar-node/2.0.0.zip", make_bundle("1.2.0", name="lidar-node", kind="node", entry="a:b"))
    repository.publish()
    with pytest.raises(UpdateForeignError):
        await found.get("lidar-node", "2.0.0")
    assert found.ready("lidar-node", "2.0.0") is None
    robot.source.minimum.raise_to("shell", "1.0.1")
    with pytest.raises(UpdateFloorError):
        await found.get("shell", "1.0.0")
    for name, version in (("../x", "1.0.0"), ("shell", "../1.0.0"), ("", "1.0.0")):
        with pytest.raises(BundleError):
            found.ready(name, version)


async def test_what_is_below_the_floor_does_not_come_back_from_the_disk(world: World) -> None:
    robot, _, _ = world
    found = bundles(robot)
    await found.get("shell", "1.0.0")
    await found.get("shell", "1.0.2")
    robot.source.minimum.raise_to("shell", "1.0.1")
    with pytest.raises(UpdateFloorError):
        found.ready("shell", "1.0.0")
    with pytest.raises(UpdateFloorError):
        await found.get("shell", "1.0.0")
    assert found.ready("shell", "1.0.2") is not None


async def test_a_robot_without_an_enrolment_takes_none(tmp_path: Path) -> None:
    with pytest.raises(UpdateOffError):
        await NodeBundles(tmp_path, lambda: None).get("shell", "1.0.0")


async def test_a_bundle_without_its_mark_is_made_anew(world: World) -> None:
    robot, _, _ = world
    found = bundles(robot)
    folder = (await found.get("shell", "1.0.0")).folder
    (folder / "complete.json").unlink()
    (folder / "files" / "run.sh").write_text("half")
    assert found.ready("shell", "1.0.0") is None
    again = await found.get("shell", "1.0.0")
    assert "1.0.0" in (again.folder / "files" / "run.sh").read_text()


async def test_the_oldest_that_nobody_wants_go(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, _, _ = world
    found = bundles(robot)
    for version in ("1.0.0", "1.0.1", "1.0.2"):
        await found.get("shell", version)
    assert found.collect([]) == []
    monkeypatch.setattr(nodes_module, "LIMITS", replace(LIMITS, node_bundles=1))
    assert found.collect([("shell", "1.0.0")]) == [("shell", "1.0.1"), ("shell", "1.0.2")]
    assert found.ready("shell", "1.0.0") is not None
