"""The agent's own update as the twin sees it: wanted, tried, kept or taken back."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections.abc import Iterator
from contextlib import asynccontextmanager
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest

from edge_agent.update.restart import LoaderInfo
from edge_agent.update.slots import Slots
from edge_agent.update.source import Source
from edge_agent.update.updater import AgentUpdates
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.support.robots.tuf_robot import OLD, TufRobot, fill_slot, tuf_robot
from tests.support.servers.tuf_repository import Served, TufRepository, plain
from tests.support.waiting import wait_until_async

World = tuple[TufRobot, TufRepository, Served]


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    with tuf_robot(tmp_path) as found:
        yield found


@asynccontextmanager
async def running(updates: AgentUpdates) -> Iterator[None]:
    """Its task, while the block runs."""
    task = asyncio.create_task(updates.run())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait({task})


def on_trial(state: Path, *, health_s: float, link_s: float, restarts: list[int]) -> AgentUpdates:
    """2.1.0 after its first start; 2.0.0 ran before."""
    slots = Slots(state)
    slots.switch(fill_slot(slots, "a", OLD), OLD)
    slots.mark_good()
    slots.switch(fill_slot(slots, "b", "2.1.0", min_version="2.0.5"), "2.1.0")
    slots.boot(most=3)
    source = Source(state / "update", "http://127.0.0.1:1", lambda: None, SystemClock())  # type: ignore[arg-type,return-value]
    source.folder.mkdir(parents=True)
    told = LoaderInfo(loader=("x",), health_s=health_s, link_s=link_s)
    return AgentUpdates(
        slots,
        source,
        SystemClock(),
        random.Random(1),
        loader_info=told,
        running="?",
        restart=lambda: restarts.append(1),
    )


async def settle() -> None:
    """Until everything that can go on has done so."""
    for _ in range(50):
        await asyncio.sleep(0)


def state_of(updates: AgentUpdates) -> str:
    return str(updates.reported()["update"]["state"])


async def test_a_version_that_stays_linked_is_kept_and_brings_its_floor(tmp_path: Path) -> None:
    restarts: list[int] = []
    updates = on_trial(tmp_path, health_s=0.05, link_s=60.0, restarts=restarts)
    changes: list[str] = []
    updates.changed = lambda: changes.append(state_of(updates))
    assert updates.reported() == {
        "version": "2.1.0",
        "slot": "b",
        "update": {"state": "trying", "version": "2.1.0", "code": "", "message": ""},
    }
    async with running(updates):
        updates.link_up(lambda frame: None, link_pb2.Welcome(fetch_token="mrf_1"))
        await wait_until_async(lambda: state_of(updates) == "healthy")
    current = Slots(tmp_path).read()
    assert (current.state, current.version) == ("good", "2.1.0")
    assert Source(tmp_path / "update", "http://x", lambda: None, SystemClock()).minimum.of("metaros") == "2.0.5"  # type: ignore[arg-type,return-value]
    assert changes == ["healthy"]
    assert restarts == []


async def test_a_version_that_never_links_takes_itself_back(tmp_path: Path) -> None:
    restarts: list[int] = []
    updates = on_trial(tmp_path, health_s=0.05, link_s=0.1, restarts=restarts)
    async with running(updates):
        await wait_until_async(lambda: bool(restarts))
    current = Slots(tmp_path).read()
    assert (current.version, current.failed_version) == (OLD, "2.1.0")
    assert current.failed_reason == "it never linked to a gateway"
    assert updates.reported()["update"]["code"] == "update_unhealthy"
    assert Source(tmp_path / "update", "http://x", lambda: None, SystemClock()).minimum.of("metaros") == ""  # type: ignore[arg-type,return-value]


async def test_a_version_whose_link_breaks_is_not_kept(tmp_path: Path) -> None:
    restarts: list[int] = []
    updates = on_trial(tmp_path, health_s=0.05, link_s=0.1, restarts=restarts)
    updates.link_up(lambda frame: None, link_pb2.Welcome())
    updates.link_down()
    async with running(updates):
        await wait_until_async(lambda: bool(restarts))
    assert Slots(tmp_path).read().version == OLD


async def test_what_is_wanted_is_installed_and_asked_to_be_started(world: World) -> None:
    robot, _, served = world
    served.token = "mrf_2"
    states: list[str] = []
    robot.updates.changed = lambda: states.append(state_of(robot.updates))
    async with running(robot.updates):
        await robot.updates.want("2.1.0")
        await wait_until_async(lambda: robot.code == "update_fetch")  # it has no token yet
        assert state_of(robot.updates) == "downloading"
        robot.updates.link_up(lambda frame: None, link_pb2.Welcome(fetch_token="mrf_2"))
        await wait_until_async(lambda: robot.restarts == 1)
    assert robot.slots.read().version == "2.1.0"
    assert states[-1] == "staged"


async def test_nothing_is_fetched_for_the_version_that_runs_or_for_none(world: World) -> None:
    robot, _, served = world
    async with running(robot.updates):
        for version in ("", None, OLD):
            await robot.updates.want(version)
            await settle()
        await robot.updates.want("9.9.9")
        await wait_until_async(lambda: robot.code == "update_unknown")
        asked = len(served.asked)
        await robot.updates.want(OLD)
        assert state_of(robot.updates) == "healthy"
        await settle()
    assert len(served.asked) == asked


def taken_back(robot: TufRobot, served: Served) -> list[str]:
    """2.1.0 has ended too often, and the agent begins anew; the bundles that it asks for, and does not get."""
    robot.slots.switch(fill_slot(robot.slots, "b", "2.1.0"), "2.1.0")
    for _ in range(4):
        current = robot.slots.boot(most=3)
    assert current.version == OLD
    robot.begin()
    asked: list[str] = []

    def refuse(handler: BaseHTTPRequestHandler, data: bytes) -> None:
        asked.append(handler.path.rpartition(".zip")[0][-5:])
        plain(handler, b"", status=404)

    served.misbehave(".zip", refuse)
    return asked


async def test_a_version_that_was_taken_back_is_not_tried_again(world: World) -> None:
    robot, repository, served = world
    asked = taken_back(robot, served)
    repository.add_agent("2.1.1")
    repository.publish()
    assert robot.updates.reported()["update"]["state"] == "rolled_back"
    async with running(robot.updates):
        before = len(served.asked)
        await robot.updates.want("2.1.0")
        await settle()
        assert len(served.asked) == before
        await robot.updates.want("2.1.1")
        await wait_until_async(lambda: bool(asked))
    assert asked == ["2.1.1"]


async def test_it_is_tried_again_once_what_runs_was_wanted_by_name(world: World) -> None:
    robot, _, served = world
    asked = taken_back(robot, served)
    async with running(robot.updates):
        await robot.updates.want(OLD)
        assert state_of(robot.updates) == "healthy"
        await robot.updates.want("2.1.0")
        await wait_until_async(lambda: bool(asked))
    assert asked == ["2.1.0"]


async def test_a_robot_that_is_not_enrolled_refuses(world: World) -> None:
    robot, _, _ = world
    loader_info = LoaderInfo(loader=("x",))
    updates = AgentUpdates(
        robot.slots, None, robot.clock, random.Random(1), loader_info=loader_info, running=OLD, restart=lambda: None
    )
    assert not await updates.attempt("2.1.0")
    assert updates.reported()["update"]["code"] == "update_off"
    assert state_of(updates) == "refused"


async def test_an_agent_without_a_loader_says_so_and_fetches_nothing(world: World) -> None:
    robot, _, served = world
    updates = AgentUpdates(
        robot.slots,
        robot.source,
        robot.clock,
        random.Random(1),
        loader_info=None,
        running="2.0.0.dev1",
        restart=lambda: None,
    )
    assert updates.reported()["update"]["state"] == "off"
    async with running(updates):
        await updates.want("2.1.0")
        await settle()
        update = updates.reported()["update"]
        assert (update["state"], update["version"], update["code"]) == ("refused", "2.1.0", "update_off")
        await updates.want("2.0.0.dev1")
        assert updates.reported()["update"]["state"] == "off"
    assert updates.reported()["version"] == "2.0.0.dev1"
    assert served.asked == []
