"""What viewers of one gateway see of a robot that is linked to the other: over every protocol, as at its home."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import grpc
import httpx

from metaros._proto import link_pb2, telemetry_pb2, telemetry_pb2_grpc
from tests.gateway.api.foxglove.robot import STRING, text
from tests.gateway.api.foxglove.viewer import viewing
from tests.gateway.cluster.test_two_gateways import Pair, linked, pair, until
from tests.gateway.harness import (
    CONTROL,
    OPERATOR_KEY,
    ScriptedAgent,
    channel,
    client,
    hear,
    hear_bytes,
    open_socket,
    say,
)
from tests.support.key_ring import bearer
from tests.support.viewer import records

__all__ = ["pair"]

LIVE, BULK = 4, 3
SERIES = link_pb2.Series(series_id=1, name="battery.percentage", topic="/sim_1/battery", field="percentage")


@asynccontextmanager
async def doing(work: Callable[[], Awaitable[Any]]) -> AsyncIterator[None]:
    """Again and again, until the block ends."""

    async def go_on() -> None:
        while True:
            await work()
            await asyncio.sleep(0.02)

    task = asyncio.create_task(go_on())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def demanded(agent: ScriptedAgent, number: int, *, wanted: bool) -> None:
    """Wait until the robot was told that viewers want a channel, or do no more."""
    async with asyncio.timeout(60):
        while True:
            told = (await agent.next("demand")).demand
            if (number in {entry.channel_id for entry in told.entries}) == wanted:
                return


async def robot(http: httpx.AsyncClient) -> dict[str, Any]:
    """How a gateway shows the robot."""
    return dict((await http.get("/api/v1/robots/sim_1")).json())


async def test_live_topics_leave_the_robot_for_viewers_of_the_other_gateway(pair: Pair) -> None:
    async with linked(pair.one, pair.two) as agent:
        await agent.announce(channel(2, "/sim_1/scan", STRING, delivery=LIVE))
        seq = 0

        async def samples() -> None:
            nonlocal seq
            seq += 1
            await agent.samples(2, seq, [text(f"live {seq}")])

        async with open_socket(pair.two, "/api/v1/stream") as socket:
            await say(socket, op="subscribe", id=1, robots="sim_1", topics="**/scan")
            await demanded(agent, 2, wanted=True)
            async with doing(samples):
                got = list(records(await hear_bytes(socket)))
            assert got[0].payload == text(f"live {got[0].seq}")
        await demanded(agent, 2, wanted=False)


async def test_foxglove_and_grpc_show_the_robot_of_the_other_gateway(pair: Pair) -> None:
    async with linked(pair.one, pair.two) as agent:
        seq = 0

        async def samples() -> None:
            nonlocal seq
            seq += 1
            await agent.samples(1, seq, [text(f"text {seq}")], stamp_ns=10**18 + seq)

        async with doing(samples):
            async with viewing(pair.two, "/sim_1") as viewer:
                offered = await viewer.channel("/sim_1/chatter")
                assert (offered["schemaName"], offered["encoding"]) == (STRING, "cdr")
                await viewer.subscribe(7, "/sim_1/chatter")
                number, stamp_ns, payload = await viewer.data()
                assert (number, payload) == (7, text(f"text {stamp_ns - 10**18}"))
            async with grpc.aio.insecure_channel(f"127.0.0.1:{pair.two.api_grpc_port}") as opened:
                stub: Any = telemetry_pb2_grpc.TelemetryServiceStub(opened)
                asked = telemetry_pb2.SubscribeRequest(robots=["sim_*"], topics=["chatter"])
                key = tuple((name.lower(), value) for name, value in bearer(OPERATOR_KEY).items())
                replies = stub.Subscribe(asked, metadata=key, timeout=60)
                async for reply in replies:
                    if reply.samples:
                        sample = reply.samples[0]
                        assert sample.cdr == text(f"text {sample.seq}")
                        break
                replies.cancel()


async def test_values_and_counts_are_those_of_the_robots_home(pair: Pair) -> None:
    async with linked(pair.one, pair.two) as agent, client(pair.one) as one, client(pair.two) as two:
        await agent.announce(series=[SERIES])
        async with open_socket(pair.two, "/api/v1/stream") as socket:
            await say(socket, op="subscribe_metrics", id=1, robots="*", series=["battery.*"])
            row = 0

            async def rows() -> None:
                nonlocal row
                row += 1
                await agent.rows(row, [(1, 10**18 + row, 0.5)])

            async with doing(rows):
                told = await hear(socket, "metrics")
            assert (told["robot"], told["values"]) == ("sim_1", {"battery.percentage": 0.5})
        statistics = link_pb2.TopicStatistics(topics=[link_pb2.TopicRate(channel_id=1, rate_hz=12.5)], outbox_bytes=9)
        await agent.send(CONTROL, statistics=statistics)

        async def same() -> bool:
            here, there = await robot(one), await robot(two)
            names = ("state", "since", "hostname", "namespace", "labels", "counts", "channels", "latest")
            alike = all(here[name] == there[name] for name in names)
            return alike and here["link"]["outbox_bytes"] == there["link"]["outbox_bytes"] == 9

        await until(same)
        (topic,) = (await two.get("/api/v1/robots/sim_1/topics")).json()["topics"]
        assert topic["rate_hz"] == 12.5
        listed = (await two.get("/api/v1/robots?state=online")).json()["robots"]
        assert [item["id"] for item in listed] == ["sim_1"]
        metrics = (await two.get("/metrics")).text
        assert 'metaros_robots{state="online"} 0.0' in metrics
        assert 'metaros_robots{state="elsewhere"} 1.0' in metrics
        assert "metaros_link_samples_total 0.0" in metrics


async def test_a_robot_moves_to_the_other_gateway(pair: Pair) -> None:
    async with client(pair.one) as one, client(pair.two) as two:
        async with linked(pair.one, pair.two):
            async with ScriptedAgent(pair.two, number=2, session=b"t" * 16) as moved, moved.beating():
                await moved.announce(channel(1, "/sim_1/chatter", STRING), channel(2, "/sim_1/new", STRING))

                async def there() -> bool:
                    views = [await robot(one), await robot(two)]
                    return all(
                        (view["state"], view["link"]["session"], view["channels"]) == ("online", 2, 2) for view in views
                    )

                await until(there)
                metrics = (await one.get("/metrics")).text
                assert 'metaros_robots{state="elsewhere"} 1.0' in metrics

            async def gone() -> bool:
                return [(await robot(http))["state"] for http in (one, two)] == ["offline", "offline"]

            await until(gone)

        async def kinds() -> list[str]:
            events = (await two.get("/api/v1/events?robot=sim_1&limit=100")).json()["events"]
            return [event["type"] for event in events if event["type"].startswith("metaros.robot.")]

        async def told() -> bool:
            return len(await kinds()) == 3

        await until(told)
        assert sorted(await kinds()) == ["metaros.robot.offline", "metaros.robot.online", "metaros.robot.online"]
