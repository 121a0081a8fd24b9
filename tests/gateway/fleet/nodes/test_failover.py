"""Failover on a real store: which node is whose unit, who gets a lease, and that nobody has it twice."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.robot import Robot
from gateway.errors import RobotOfflineError, StoreError
from gateway.fleet.nodes.failover import STEP_S, Failover, can_run
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit
from gateway.store import RobotWrite, Store
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.fleet.twin_rig import twins_on
from tests.support.servers.postgres import PostgresServer

ADMIN = Editor(name="ada", code=True)
WAITS = {"state": "stopped", "why": "no lease", "quarantined": False}
PROMISED_S = 10.0  # from the loss of a host to the lease of the next one
ROW = {"allowed": "beat", "migratable": True}


class Fleet:
    """Robots that answer each frame with their clock, unless they are silent; and what each was told last."""

    def __init__(self, tasks: asyncio.TaskGroup) -> None:
        self.clock = ManualClock()
        self.told: dict[str, dict[str, int]] = {}
        self.silent: set[str] = set()
        self.twins: Twins
        self.failover: Failover
        self.tasks = tasks
        self.others: list[Fleet] = []  # of other gateways, by the same clock

    def send(self, robot: str, frame: link_pb2.GatewayFrame) -> None:
        if frame.WhichOneof("frame") != "node_leases":
            return
        if robot in self.silent:
            raise RobotOfflineError(f"robot {robot} has no link now")
        if frame.node_leases.since_ns:
            self.told[robot] = {one.node: one.epoch for one in frame.node_leases.leases}
        self.failover.on_answer(robot, round(self.clock.monotonic_s() * 1e9) + 1)

    async def robot(self, store: Store, name: str, **labels: str) -> None:
        store.submit(RobotWrite(Robot(name, labels=labels), 1))
        await store.flush()
        self.failover.on_online(name, True)
        self.reports(name)

    def reports(self, name: str, **nodes: Any) -> None:
        known = {"map": WAITS, **nodes}
        report = link_pb2.TwinReport(state="applied", reported=json.dumps({"nodes": known}).encode())
        self.twins.on_report(name, report)

    async def step(self) -> None:
        """A quarter of a second goes by, and what was to be stored then is."""
        self.clock.advance(STEP_S)
        for one in (self, *self.others):
            await one.failover.step(one.tasks)
            if one.failover._writing is not None:
                await asyncio.wait({one.failover._writing})

    async def until(self, holders: dict[str, dict[str, int]], *, for_s: float = 0.0) -> None:
        """Time goes by until these robots have these nodes, under these epochs; `for_s` at least."""
        end_s = self.clock.monotonic_s() + for_s
        async with asyncio.timeout(60):
            while True:
                await self.step()
                held = {robot: leases for robot, leases in self.told.items() if leases and robot not in self.silent}
                assert sum("map" in leases for leases in held.values()) <= 1
                if held == holders and self.clock.monotonic_s() >= end_s:
                    return

    async def template(self, name: str, selector: str, row: dict[str, Any], *, priority: int = 0) -> None:
        await self.twins.templates.put(
            name, selector=selector, document={"nodes": {"map": row}}, priority=priority, editor=ADMIN, dry_run=False
        )


@pytest.fixture
async def fleet(tmp_path: Path) -> AsyncIterator[tuple[Fleet, Store]]:
    async with asyncio.TaskGroup() as tasks:
        fleet = Fleet(tasks)
        async with twins_on("", tmp_path, fleet.send, lambda robot: {}) as (store, twins):
            fleet.twins = twins
            fleet.failover = Failover(store, twins, fleet.send, clock=fleet.clock)
            yield fleet, store


async def test_it_moves_when_its_robot_is_lost_and_stays_when_that_is_back(fleet: tuple[Fleet, Store]) -> None:
    here, store = fleet
    await here.robot(store, "r1")
    await here.robot(store, "r2")
    await here.template("all", "", ROW)
    await here.until({"r1": {"map": 1}})
    assert here.failover.holder_of("r2", "map") == "r1"
    here.failover.on_online("r1", False)
    here.silent.add("r1")
    lost_s = here.clock.monotonic_s()
    await here.until({"r2": {"map": 2}})
    assert here.clock.monotonic_s() - lost_s <= PROMISED_S
    here.silent.clear()
    here.told.pop("r1")
    await here.robot(store, "r1")
    await here.until({"r2": {"map": 2}}, for_s=20.0)
    assert here.failover.holder_of("r1", "map") == "r2"


@pytest.mark.integration
async def test_two_gateways_of_one_store_and_one_of_them_dies(postgres: PostgresServer, tmp_path: Path) -> None:
    async with asyncio.TaskGroup() as tasks:
        url, here, there = postgres.schema(), Fleet(tasks), Fleet(tasks)
        there.clock, there.told = here.clock, here.told
        async with (
            twins_on(url, tmp_path / "a", here.send, lambda robot: {}) as (store, here.twins),
            twins_on(url, tmp_path / "b", there.send, lambda robot: {}) as (other, there.twins),
        ):
            here.failover = Failover(store, here.twins, here.send, clock=here.clock)
            there.failover = Failover(other, there.twins, there.send, clock=here.clock)
            here.others.append(there)
            await here.robot(store, "r1")
            store.submit(RobotWrite(Robot("r2"), 1))
            await store.flush()
            await here.template("all", "", ROW)
            await here.until({"r1": {"map": 1}})
            await there.robot(other, "r2")
            await here.until({"r1": {"map": 1}}, for_s=20.0)  # the other gateway sees that it goes on
            here.told.pop("r1")  # by its own clock it ends; nobody renews it
            died_s = here.clock.monotonic_s()
            await there.until({"r2": {"map": 2}})
            assert here.clock.monotonic_s() - died_s > LIMITS.node_lease_valid_s


async def test_a_quarantined_node_moves_once_and_not_in_a_circle(fleet: tuple[Fleet, Store]) -> None:
    here, store = fleet
    await here.robot(store, "r1")
    await here.robot(store, "r2")
    await here.template("all", "", ROW)
    await here.until({"r1": {"map": 1}})
    here.reports("r1", map={"state": "quarantined", "quarantined": True})
    await here.until({"r2": {"map": 2}})
    here.reports("r1")
    here.reports("r2", map={"state": "quarantined", "quarantined": True})
    await here.until({"r2": {"map": 2}}, for_s=20.0)


@pytest.mark.parametrize("authenticator", ["run", "read"])
async def test_while_the_store_is_away_nobody_gets_a_lease_and_it_is_said_once(
    fleet: tuple[Fleet, Store], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, authenticator: str
) -> None:
    here, store = fleet
    await here.robot(store, "r1")
    await here.template("all", "", ROW)

    async def away(job: object) -> None:
        raise StoreError("the disk is full")

    for _ in range(2):
        with monkeypatch.context() as patched:
            patched.setattr(store, authenticator, away)
            here.failover._unsure = True
            for _ in range(120):
                await here.step()
            assert here.failover.holder_of("r1", "map") is None
        assert [record.message for record in caplog.records if record.name == "gateway.fleet.nodes.failover"] == [
            "leases of migratable nodes cannot be stored or read now: the disk is full"
        ]
    await here.until({"r1": {"map": 1}})  # although somebody asked for its holder before it was offered


async def test_a_template_over_a_template_makes_no_second_unit(fleet: tuple[Fleet, Store]) -> None:
    here, store = fleet
    await here.robot(store, "r1", kind="arm")
    await here.robot(store, "r2")
    await here.template("base", "", ROW)
    await here.template("over", "robot=r1", {"nice": 5, "migratable": True}, priority=5)
    await here.until({"r1": {"map": 1}})
    lease = here.failover.lease_of("r2", "map")
    assert lease is not None
    assert (lease.unit.scope, lease.robot) == ("base", "r1")


async def test_a_robots_own_node_is_its_own(fleet: tuple[Fleet, Store]) -> None:
    here, store = fleet
    for name in ("r1", "r2"):
        await here.robot(store, name)
        await here.twins.manager.edit(name, Edit(patch={"nodes": {"own": ROW}}), ADMIN, dry_run=False)
        here.reports(name, own=WAITS)
    await here.until({"r1": {"own": 1}, "r2": {"own": 1}})
    await here.twins.manager.edit("r1", Edit(patch={"nodes": {"own": {"run": False}}}), ADMIN, dry_run=False)
    here.told.pop("r1")
    await here.until({"r2": {"own": 1}})
    assert here.failover.holder_of("r1", "own") is None


@pytest.mark.parametrize(
    ("row", "able"),
    [
        (WAITS, True),
        ({"state": "running", "pid": 7}, True),
        ({"state": "waiting", "last_exit": "exit code 1"}, True),  # its supervisor starts it again
        ({"state": "stopped", "why": "by hand"}, False),
        ({"state": "waiting", "why": "the supervisor has not taken it yet"}, False),
        ({"state": "quarantined", "quarantined": True}, False),
        ({"state": "refused", "last_exit": "no such bundle"}, False),
        ({"state": "fetching"}, False),
        (None, False),
        ("running", False),
    ],
)
def test_where_it_could_run(row: object, able: bool) -> None:
    assert can_run(row) is able
