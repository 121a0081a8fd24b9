"""Where robots are, as gateways of one store tell each other; and a rollout to robots of another gateway."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import orjson

from gateway.fleet.presence import ALIVE_NS, Presence
from gateway.store import Store
from gateway.store.retention import Retention
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from tests.gateway.api.rest.fleet.test_updates import ADMIN, published
from tests.gateway.harness import CONTROL, ScriptedAgent, client, running_gateway
from tests.support.servers.postgres import PostgresServer

NOW_NS = 1_800_000_000 * 10**9
ROW = {"nodes": {"lidar": {"bundle": "lidar-node", "version": "0.9.0"}}}


@asynccontextmanager
async def gateway_on(
    folder: Path, url: str, clock: ManualClock, here: dict[str, tuple[bool, int]]
) -> AsyncIterator[Presence]:
    retention = Retention(age_s=100.0, size_bytes=1 << 30)
    store = Store(folder, clock=clock, retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    try:
        yield Presence(store, lambda robot: here.get(robot, (False, 0)), clock=clock)
    finally:
        await store.close()


async def test_what_one_gateway_says_the_other_knows(tmp_path: Path, postgres: PostgresServer) -> None:
    url, clock = postgres.schema(), ManualClock(wall_ns=NOW_NS)
    at_a, at_b = dict[str, tuple[bool, int]](), dict[str, tuple[bool, int]]()
    async with gateway_on(tmp_path / "a", url, clock, at_a) as a, gateway_on(tmp_path / "b", url, clock, at_b) as b:

        async def told(one: Presence, here: dict[str, tuple[bool, int]], robot: str, online: bool) -> None:
            here[robot] = (online, clock.wall_ns())
            one.on_online(robot)
            await one.publish()
            await a.look()
            await b.look()

        await told(a, at_a, "r1", True)
        assert (a.of("r1"), b.of("r1")) == ((True, NOW_NS), (True, NOW_NS))
        assert (a.is_here("r1"), b.is_here("r1")) == (True, False)
        clock.advance(1)
        await told(b, at_b, "r1", True)  # it moved; the first gateway notices later
        await told(a, at_a, "r1", False)
        assert (a.of("r1"), b.of("r1")) == ((True, NOW_NS + 10**9), (True, NOW_NS + 10**9))
        clock.advance(1)
        await told(b, at_b, "r1", False)
        assert (a.of("r1"), b.of("r1")) == ((False, NOW_NS + 2 * 10**9), (False, NOW_NS + 2 * 10**9))
        await told(a, at_a, "r2", True)
        clock.advance(ALIVE_NS / 1e9)  # and the gateway is never heard of again
        await b.look()
        assert b.of("r2") == (False, NOW_NS + 2 * 10**9 + ALIVE_NS)
        await a.publish()
        await b.look()
        assert b.of("r2")[0]
        await a.close()
        await b.look()
        assert b.of("r2") == (False, clock.wall_ns())


async def test_a_gateway_that_was_killed_forgets_its_links_when_it_comes_back(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    url, clock = postgres.schema(), ManualClock(wall_ns=NOW_NS)
    async with gateway_on(tmp_path / "b", url, clock, {}) as b:
        async with gateway_on(tmp_path / "a", url, clock, {"r1": (True, NOW_NS)}) as a:
            a.on_online("r1")
            await a.publish()
        async with gateway_on(tmp_path / "a", url, clock, {}) as again:
            await again.publish()
            await b.look()
            assert not b.of("r1")[0]


async def test_a_gateway_that_is_alone_writes_nothing(tmp_path: Path) -> None:
    async with gateway_on(tmp_path, "", ManualClock(wall_ns=NOW_NS), {"r1": (True, NOW_NS)}) as alone:
        alone.on_online("r1")
        await alone.publish()
        await alone.look()
        assert (alone.of("r1"), alone.of("r2")) == ((True, NOW_NS), (False, 0))
        store = alone._store
        assert await store.run(lambda engine: engine.fetch("SELECT * FROM gateways")) == []


async def say(agent: ScriptedAgent, frame: link_pb2.TwinDesired | None, version: str) -> None:
    """The robot lives by what it was sent, and its node runs that version."""
    reported = {"nodes": {"lidar": {"state": "running", "version": version}}}
    revision = frame.revision if frame is not None else 0
    report = link_pb2.TwinReport(
        revision=revision,
        applied=revision,
        state="applied",
        sha256=frame.sha256 if frame is not None else b"",
        reported=orjson.dumps(reported),
    )
    await agent.send(CONTROL, twin=report)


async def test_a_rollout_reaches_the_robots_of_another_gateway(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with (
        running_gateway(tmp_path / "one", store_url=url, objects_url=f"file://{tmp_path}/objects") as one,
        client(one, key=ADMIN) as http,
    ):
        await published(one, tmp_path / "people")
        master = (tmp_path / "one" / "data" / "master.key").read_bytes()
        (tmp_path / "two" / "data").mkdir(parents=True, mode=0o700)
        (tmp_path / "two" / "data" / "master.key").write_bytes(master)
        (tmp_path / "two" / "data" / "master.key").chmod(0o600)
        async with (
            running_gateway(tmp_path / "two", store_url=url, objects_url=f"file://{tmp_path}/objects") as two,
            client(two, key=ADMIN) as there,
            ScriptedAgent(two) as agent,
        ):
            await say(agent, None, "0.9.0")
            row = await there.patch("/api/v1/robots/sim_1/twin", json=ROW)
            assert row.status_code == 200, row.text
            await say(agent, (await agent.next("twin")).twin, "0.9.0")
            plan = {
                "node": "lidar",
                "bundle": "lidar-node",
                "version": "1.0.0",
                "selector": "robot=sim_1",
                "steady_s": 0,
            }
            started = await http.post("/api/v1/rollouts", json=plan)  # at the gateway that never saw the robot
            assert started.status_code == 201, started.text
            found = await until(http, started.json()["id"], lambda item: item["counts"]["updating"] == 1)
            assert found["state"] == "running"
            frame = (await agent.next("twin")).twin
            assert orjson.loads(frame.document)["nodes"]["lidar"]["version"] == "1.0.0"
            await say(agent, frame, "1.0.0")
            found = await until(http, started.json()["id"], lambda item: item["state"] != "running")
            assert (found["state"], found["counts"]["done"]) == ("done", 1), found


async def until(http: Any, rollout: str, good: Any) -> dict[str, Any]:
    """The rollout once it is so."""
    async with asyncio.timeout(60):
        while True:
            item = dict((await http.get(f"/api/v1/rollouts/{rollout}")).json())
            if good(item):
                return item
            await asyncio.sleep(0.1)
