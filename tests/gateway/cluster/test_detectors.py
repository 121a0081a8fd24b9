"""What is learned of a robot goes with it from one real gateway to the other, and is seen at both."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx

from gateway.main import Ready
from metaros._proto import link_pb2
from tests.gateway.cluster.test_two_gateways import Pair, pair, until
from tests.gateway.harness import ScriptedAgent, client

__all__ = ["pair"]

START_NS = 1_700_000_000 * 10**9
SERIES = link_pb2.Series(series_id=1, name="imu.x", topic="/imu", field="x")


async def learned(http: httpx.AsyncClient) -> int:
    """Seconds of the one series that are learned, as a gateway says."""
    found: dict[str, Any] = (await http.get("/api/v1/robots/sim_1/watch")).json()
    return next((int(row["seen"]) for row in found["series"]), 0)


async def send(agent: ScriptedAgent, first: int, last: int) -> None:
    """A row a second, by the robot's clock."""
    for seq in range(first, last + 1):
        await agent.rows(seq, [(1, START_NS + seq * 10**9, seq % 7 / 10.0)])


async def has(ready: Ready, seen: int) -> None:
    """Wait until a gateway says that so much is learned."""

    async def enough() -> bool:
        async with client(ready) as http:
            return await learned(http) >= seen

    await until(enough, timeout_s=60.0)


async def test_what_is_learned_goes_on_at_the_other_gateway(pair: Pair) -> None:
    async with ScriptedAgent(pair.one, number=1) as agent, agent.beating():
        await agent.announce(series=[SERIES])
        await send(agent, 1, 40)
        await has(pair.one, 39)
        await has(pair.two, 39)  # it asks the first one
    await asyncio.sleep(0)
    async with ScriptedAgent(pair.two, number=2) as agent, agent.beating():
        await agent.announce(series=[SERIES])
        await send(agent, 41, 60)
        await has(pair.two, 59)
        await has(pair.one, 59)
        async with client(pair.two) as http:
            assert await learned(http) == 59
