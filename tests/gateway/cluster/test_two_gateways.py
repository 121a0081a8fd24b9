"""Two real gateways on one PostgreSQL, a router between them: each serves the robot that is linked to one.

Over every protocol viewers of one see a robot that is linked to the other as at its home.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import grpc
import httpx
import pytest

from gateway.main import Ready
from metaros._proto import link_pb2, telemetry_pb2, telemetry_pb2_grpc
from tests.gateway.api.foxglove.robot import STRING, text
from tests.gateway.api.foxglove.viewer import viewing
from tests.gateway.cluster.gateway_pair import Pair, has, until
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
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.viewer import records

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.xdist_group("gateway pair")]

LIVE = 4
SERIES = link_pb2.Series(series_id=1, name="battery.percentage", topic="/battery", field="percentage")
IMU = link_pb2.Series(series_id=1, name="imu.x", topic="/imu", field="x")
START_NS = 1_700_000_000 * 10**9


async def test_a_robot_is_seen_at_the_other_gateway(pair: Pair) -> None:
    async with pair.linked() as agent, client(pair.two) as http:
        assert (await http.get(pair.path)).json()["state"] == "online"
        async with open_socket(pair.two, "/api/v1/stream") as socket:
            await say(socket, op="subscribe", id=1, robots="*", topics="**/chatter")
            payload = b"\0\1\0\0\6\0\0\0hello\0"

            async def send() -> None:
                for seq in range(1, 1000):
                    await agent.samples(1, seq, [payload])
                    await asyncio.sleep(0.05)

            sending = asyncio.create_task(send())
            record = next(records(await hear_bytes(socket)))
            sending.cancel()
            assert record.payload == payload

    async with client(pair.two) as http:

        async def gone() -> bool:
            return bool((await http.get(pair.path)).json()["state"] == "offline")

        await until(gone)


async def test_a_command_goes_by_the_other_gateway(pair: Pair) -> None:
    async with pair.linked() as agent, client(pair.two) as http:

        async def answer() -> None:
            command = (await agent.next("command")).command
            assert command.WhichOneof("action") == "call_service"
            await agent.answer(command, code="unreachable")

        answering = asyncio.create_task(answer())
        body = {"kind": "call_service", "request": {"service": pair.topic("do"), "type": "std_srvs/srv/Trigger"}}
        said = await http.post(f"{pair.path}/commands", json=body)
        await answering
        assert said.status_code in (200, 201), said.text
        assert said.json()["state"] == "failed"
        assert said.json()["code"] == "unreachable"


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
            reported = (await agent.next("demand")).demand
            if (number in {entry.channel_id for entry in reported.entries}) == wanted:
                return


async def test_live_topics_leave_the_robot_for_viewers_of_the_other_gateway(pair: Pair) -> None:
    async with pair.linked() as agent:
        await agent.announce(channel(2, pair.topic("scan"), STRING, delivery=LIVE))
        seq = 0

        async def samples() -> None:
            nonlocal seq
            seq += 1
            await agent.samples(2, seq, [text(f"live {seq}")])

        async with open_socket(pair.two, "/api/v1/stream") as socket:
            await say(socket, op="subscribe", id=1, robots=pair.robot, topics="**/scan")
            await demanded(agent, 2, wanted=True)
            async with doing(samples):
                got = list(records(await hear_bytes(socket)))
            assert got[0].payload == text(f"live {got[0].seq}")
        await demanded(agent, 2, wanted=False)


async def test_foxglove_and_grpc_show_the_robot_of_the_other_gateway(pair: Pair) -> None:
    async with pair.linked() as agent:
        seq = 0

        async def samples() -> None:
            nonlocal seq
            seq += 1
            await agent.samples(1, seq, [text(f"text {seq}")], stamp_ns=10**18 + seq)

        async with doing(samples):
            async with viewing(pair.two, f"/{pair.robot}") as viewer:
                offered = await viewer.channel(pair.topic("chatter"))
                assert (offered["schemaName"], offered["encoding"]) == (STRING, "cdr")
                await viewer.subscribe(7, pair.topic("chatter"))
                number, stamp_ns, payload = await viewer.data()
                assert (number, payload) == (7, text(f"text {stamp_ns - 10**18}"))
            async with grpc.aio.insecure_channel(f"127.0.0.1:{pair.two.api_grpc_port}") as opened:
                stub: Any = telemetry_pb2_grpc.TelemetryServiceStub(opened)
                asked = telemetry_pb2.SubscribeRequest(robots=[f"{pair.robot[:-1]}*"], topics=["chatter"])
                key = tuple((name.lower(), value) for name, value in bearer(OPERATOR_KEY).items())
                replies = stub.Subscribe(asked, metadata=key, timeout=60)
                async for reply in replies:
                    if reply.samples:
                        sample = reply.samples[0]
                        assert sample.cdr == text(f"text {sample.seq}")
                        break
                replies.cancel()


async def test_values_and_counts_are_those_of_the_robots_home(pair: Pair) -> None:
    async with pair.linked() as agent, client(pair.one) as one, client(pair.two) as two:
        await agent.announce(series=[SERIES])
        taken = re.search(r"metaros_link_samples_total .*", (await two.get("/metrics")).text).group()
        async with open_socket(pair.two, "/api/v1/stream") as socket:
            await say(socket, op="subscribe_metrics", id=1, robots="*", series=["battery.*"])
            row = 0

            async def rows() -> None:
                nonlocal row
                row += 1
                await agent.rows(row, [(1, 10**18 + row, 0.5)])

            async with doing(rows):
                reported = await hear(socket, "metrics")
            assert (reported["robot"], reported["values"]) == (pair.robot, {"battery.percentage": 0.5})
        statistics = link_pb2.TopicStatistics(topics=[link_pb2.TopicRate(channel_id=1, rate_hz=12.5)], outbox_bytes=9)
        await agent.send(CONTROL, statistics=statistics)

        async def same() -> bool:
            here, there = await pair.view(one), await pair.view(two)
            names = ("state", "since", "hostname", "namespace", "labels", "counts", "channels", "latest")
            alike = all(here[name] == there[name] for name in names)
            return alike and here["link"]["outbox_bytes"] == there["link"]["outbox_bytes"] == 9

        await until(same)
        (topic,) = (await two.get(f"{pair.path}/topics")).json()["topics"]
        assert topic["rate_hz"] == 12.5

        async def alone() -> bool:  # the robots of the tests before have gone
            listed = (await two.get("/api/v1/robots")).json()["robots"]
            return [item["id"] for item in listed if item["state"] == "online"] == [pair.robot]

        await until(alone)
        metrics = (await two.get("/metrics")).text
        assert 'metaros_robots{state="online"} 0.0' in metrics
        assert 'metaros_robots{state="elsewhere"} 1.0' in metrics
        assert taken in metrics, "what the other gateway takes is not counted here"


async def test_a_robot_moves_to_the_other_gateway(pair: Pair) -> None:
    async with client(pair.one) as one, client(pair.two) as two:
        async with pair.linked():
            async with pair.agent(pair.two, number=2, session=b"t" * 16) as moved, moved.beating():
                await moved.announce(channel(1, pair.topic("chatter"), STRING), channel(2, pair.topic("new"), STRING))

                async def there() -> bool:
                    views = [await pair.view(one), await pair.view(two)]
                    return all(
                        (view["state"], view["link"]["session"], view["channels"]) == ("online", 2, 2) for view in views
                    )

                await until(there)
                await has(pair.one, "/metrics", 'metaros_robots{state="elsewhere"} 1.0')

            async def gone() -> bool:
                return [(await pair.view(http))["state"] for http in (one, two)] == ["offline", "offline"]

            await until(gone)

        async def kinds() -> list[str]:
            events = (await two.get(f"/api/v1/events?robot={pair.robot}&limit=100")).json()["events"]
            return [event["type"] for event in events if event["type"].startswith("metaros.robot.")]

        async def reported() -> bool:
            return len(await kinds()) == 3

        await until(reported)
        assert sorted(await kinds()) == ["metaros.robot.offline", "metaros.robot.online", "metaros.robot.online"]


async def learned(pair: Pair, http: httpx.AsyncClient) -> int:
    """Seconds of the one series that are learned, as a gateway says."""
    found: dict[str, Any] = (await http.get(f"{pair.path}/watch")).json()
    return next((int(row["seen"]) for row in found["series"]), 0)


async def send(agent: ScriptedAgent, first: int, last: int) -> None:
    """A row a second, by the robot's clock."""
    for seq in range(first, last + 1):
        await agent.rows(seq, [(1, START_NS + seq * 10**9, seq % 7 / 10.0)])


async def learns(pair: Pair, ready: Ready, seconds: int) -> None:
    """Wait until a gateway says that so much is learned."""
    async with client(ready) as http:

        async def enough() -> bool:
            return await learned(pair, http) >= seconds

        await until(enough, timeout_s=60.0)


async def test_what_is_learned_goes_on_at_the_other_gateway(pair: Pair) -> None:
    async with pair.agent(pair.one) as agent, agent.beating():
        await agent.announce(series=[IMU])
        await send(agent, 1, 40)
        await learns(pair, pair.one, 39)
        await learns(pair, pair.two, 39)  # it asks the first one
    async with pair.agent(pair.two, number=2) as agent, agent.beating():
        await agent.announce(series=[IMU])
        await send(agent, 41, 60)
        await learns(pair, pair.two, 59)
        await learns(pair, pair.one, 59)
        async with client(pair.two) as http:
            assert await learned(pair, http) == 59
