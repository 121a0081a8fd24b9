"""The rollout manager on a real store, with robots that do what the test says."""

from __future__ import annotations

from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.fleet.rollout import Plan
from gateway.domain.idempotency import IdempotentRequest
from gateway.domain.principal import Principal
from gateway.errors import InvalidRequestError, RequestError
from gateway.fleet.rollouts.errors import RolloutStateError, UnknownRolloutError
from gateway.fleet.rollouts.manager import RolloutManager
from gateway.store import Store
from gateway.store.retention import Retention
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.servers.databases import on_both
from tests.support.servers.postgres import PostgresServer

NOW_NS = 1_800_000_000 * 10**9
PLAN = Plan(kind="agent", node="", bundle="metaros", version="2.0.0", selector="", waves=("1", "2"), steady_s=0.0)


@dataclass
class Fleet:
    """Robots r0 to r5, all online, of version 1.0.0."""

    said: dict[str, dict[str, Any]] = field(
        default_factory=lambda: {f"r{n}": {"agent": {"version": "1.0.0"}} for n in range(6)}
    )
    told: list[tuple[str, str, str]] = field(default_factory=list)
    authors: set[str] = field(default_factory=set)
    refusing: set[str] = field(default_factory=set)
    signed: set[str] = field(default_factory=lambda: {"2.0.0", "2.0.1"})

    async def named(self, selector: str) -> list[str]:
        return [] if selector == "nobody" else list(self.said)

    async def look(self, robots: Collection[str]) -> None:
        assert set(robots) <= self.said.keys()

    def presence(self, robot: str) -> tuple[bool, int]:
        return True, 0

    def reported(self, robot: str) -> dict[str, Any] | None:
        return self.said[robot]

    def refusal(self, robot: str) -> str:
        return ""

    async def set_path(self, robot: str, path: str, value: str, *, author: str) -> None:
        if robot in self.refusing:
            raise RequestError("the template forbids it")
        self.told.append((robot, path, value))
        self.authors.add(author)

    async def available(self, kind: str, name: str, version: str) -> bool:
        return (kind, name) == ("agent", "metaros") and version in self.signed

    def obey(self) -> None:
        """Whoever was told runs the version."""
        for robot, _, version in self.told:
            self.said[robot] = {"agent": {"version": version, "update": {"state": "healthy", "version": version}}}


@asynccontextmanager
async def manager_on(url: str, folder: Path, fleet: Fleet, clock: ManualClock) -> AsyncIterator[RolloutManager]:
    store = Store(
        folder, clock=clock, retention=Retention(age_s=100.0, size_bytes=1 << 30), queue_bytes=1 << 20, url=url
    )
    store.start()
    try:
        yield RolloutManager(store, fleet, clock=clock)
    finally:
        await store.close()


async def begin(manager: RolloutManager, plan: Plan = PLAN, *, dry_run: bool = False) -> str:
    made = await manager.start(plan, by="ann", sees=lambda robot: True, dry_run=dry_run)
    return made.id


@on_both
async def test_waves_through_the_store(tmp_path: Path, store_url: str) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:
        rid = await begin(manager)
        told = []
        for _ in range(5):
            assert await manager.tick()
            told.append(len(fleet.told))
            fleet.obey()
            clock.advance(1)
        assert told == [1, 3, 6, 6, 6]
        one = await manager.get(rid)
        assert (one.state, one.count("done"), one.created_by) == ("done", 6, "ann")
        assert {(path, value) for _, path, value in fleet.told} == {("agent.version", "2.0.0")}
        assert fleet.authors == {f"rollout {rid}"}
        assert [item.id for item in await manager.list()] == [rid]


async def test_a_gateway_that_dies_is_followed_by_another(tmp_path: Path, postgres: PostgresServer) -> None:
    url, clock, fleet = postgres.schema(), ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(url, tmp_path / "b", fleet, clock) as second:
        async with manager_on(url, tmp_path / "a", fleet, clock) as first:
            rid = await begin(first)
            assert await first.tick()
            assert not await second.tick()  # one at a time
            assert (len(fleet.told), (await second.get(rid)).count("updating")) == (1, 1)
        fleet.obey()
        clock.advance(20)
        assert await second.tick()
        assert len(fleet.told) == 3
        one = await second.get(rid)
        assert (one.wave, one.count("done"), one.count("updating")) == (2, 1, 2)


async def test_a_version_that_is_withdrawn_is_reported_to_nobody_else(tmp_path: Path, store_url: str) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:
        rid = await begin(manager)
        await manager.tick()
        fleet.signed.remove("2.0.0")
        fleet.obey()  # the first wave is good, and the second would begin
        for _ in range(3):
            clock.advance(1)
            await manager.tick()
        one = await manager.get(rid)
        assert (one.state, len(fleet.told), one.count("done"), one.count("starting")) == ("paused", 1, 1, 0)
        assert "metaros 2.0.0 any more: it was withdrawn" in one.reason
        with pytest.raises(InvalidRequestError, match="cannot fetch"):
            await manager.resume(rid)
        await manager.resume(rid, version="2.0.1")
        for _ in range(6):
            await manager.tick()
            fleet.obey()
        assert {robot for robot, _, version in fleet.told if version == "2.0.1"} == set(fleet.said)
        assert (await manager.get(rid)).state == "done"


async def test_it_halts_and_goes_on_with_a_fix(tmp_path: Path, store_url: str) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:
        rid = await begin(manager)
        await manager.tick()
        robot = fleet.told[0][0]
        update = {"state": "rolled_back", "version": "2.0.0", "message": "no link"}
        fleet.said[robot] = {"agent": {"version": "1.0.0", "update": update}}
        for _ in range(3):
            await manager.tick()
        one = await manager.get(rid)
        assert (one.state, len(fleet.told)) == ("halted", 1)
        assert f"{robot} rolled_back: no link" in one.reason
        with pytest.raises(RolloutStateError):
            await manager.pause(rid, "")
        with pytest.raises(InvalidRequestError, match="cannot fetch"):
            await manager.resume(rid, version="9.9.9")
        await manager.resume(rid, version="2.0.1")
        for _ in range(6):
            await manager.tick()
            fleet.obey()
        assert (await manager.get(rid)).state == "done"
        assert {said["agent"]["version"] for said in fleet.said.values()} == {"2.0.1"}


async def test_no_robots_words_stop_a_rollout(tmp_path: Path, store_url: str) -> None:
    """What a robot says of itself goes into a database and before people: text that neither takes is left out."""
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:
        rid = await begin(manager, replace(PLAN, waves=("6",), max_failure_rate=1.0))
        await manager.tick()
        said = [
            {"state": "refused", "version": "2.0.0", "message": "\0 bad\x1b[31m\u202e" + "x" * 10_000},
            {"state": "refused", "version": "2.0.0", "message": ["\0"], "code": {"\0": 1}},
            {"state": {"a": [1]}, "version": []},
            [1, "\0"],
        ]
        for number, update in enumerate(said):
            fleet.said[f"r{number}"] = {"agent": {"version": ["2.0.0"], "update": update}}
        fleet.said["r4"] = {"agent": [], "nodes": "\0"}
        for _ in range(3):
            await manager.tick()
        one = await manager.get(rid)
        assert one.members["r0"].reason.startswith("refused: bad")
        assert {name: member.state for name, member in one.members.items() if member.state == "failed"} == {
            "r0": "failed",
            "r1": "failed",
        }
        assert all(member.reason.isprintable() and len(member.reason) < 300 for member in one.members.values())


async def test_a_twin_that_cannot_hold_it(tmp_path: Path) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet(refusing={f"r{n}" for n in range(6)})
    async with manager_on("", tmp_path, fleet, clock) as manager:
        rid = await begin(manager)
        await manager.tick()
        await manager.tick()
        one = await manager.get(rid)
        assert (one.state, one.count("failed")) == ("halted", 1)
        assert "the template forbids it" in one.reason


async def test_paused_resumed_aborted(tmp_path: Path, store_url: str) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:
        rid = await begin(manager)
        await manager.tick()
        assert (await manager.pause(rid, "lunch")).reason == "lunch"
        fleet.obey()
        for _ in range(3):
            await manager.tick()
        assert (len(fleet.told), (await manager.get(rid)).count("done")) == (1, 1)
        await manager.resume(rid)
        await manager.tick()
        assert len(fleet.told) == 3
        await manager.abort(rid, "enough")
        fleet.obey()
        await manager.tick()
        one = await manager.get(rid)
        assert (one.state, one.reason, len(fleet.told)) == ("aborted", "enough", 3)
        for call in (manager.resume(rid), manager.abort(rid, ""), manager.pause(rid, "")):
            with pytest.raises(RolloutStateError):
                await call


async def test_what_does_not_begin(tmp_path: Path) -> None:
    clock, fleet = ManualClock(wall_ns=NOW_NS), Fleet()
    async with manager_on("", tmp_path, fleet, clock) as manager:
        for plan in (
            replace(PLAN, selector="nobody"),
            replace(PLAN, version="9.9.9"),
            replace(PLAN, waves=("0",)),
            replace(PLAN, waves=()),
        ):
            with pytest.raises(InvalidRequestError):
                await begin(manager, plan)
        await begin(manager, dry_run=True)
        assert await manager.list() == []
        with pytest.raises(UnknownRolloutError):
            await manager.get("none")
        rid = await begin(manager)
        with pytest.raises(RolloutStateError, match=rid):
            await begin(manager)
        await manager.abort(rid, "")
        await begin(manager)


@on_both
async def test_a_rollout_is_begun_once_under_a_key(store_url: str, tmp_path: Path) -> None:
    fleet, clock = Fleet(), ManualClock(wall_ns=NOW_NS)
    ada = Principal(kind="user", id="1", name="ada")
    once = IdempotentRequest.of(ada, "mine", {"version": "2.0.0"})
    async with manager_on(store_url, tmp_path, fleet, clock) as manager:

        async def begin(once: IdempotentRequest, *, dry_run: bool = False) -> str:
            made = await manager.start(PLAN, by="ada", sees=lambda robot: True, dry_run=dry_run, once=once)
            return made.id

        dry, first = await begin(once, dry_run=True), await begin(once)
        assert dry != first, "a dry run uses no key up"
        fleet.said.clear()  # whatever has become of the fleet since
        assert await begin(once) == first
        with pytest.raises(IdempotencyConflictError):
            await begin(IdempotentRequest.of(ada, "mine", {"version": "2.0.1"}))
        await manager.abort(first, "")
        assert await begin(once) == first
        fleet.said["r0"] = {"agent": {"version": "1.0.0"}}
        other = await begin(IdempotentRequest.of(Principal(kind="user", id="2"), "mine", {"version": "2.0.0"}))
        assert other != first, "keys of others are other keys"
        await manager.abort(other, "")
        clock.advance(LIMITS.made_once_s + 1)
        await manager.abort(await begin(IdempotentRequest.of(ada, "another", {})), "")
        assert await begin(once) != first, "after a day it is a new one"
