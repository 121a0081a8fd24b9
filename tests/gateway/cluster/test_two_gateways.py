"""Two real gateways on one PostgreSQL, a router between them: each serves the robot that is linked to one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from gateway.main import Ready
from tests.gateway.cluster.gateway_pair import gateways
from tests.gateway.harness import ScriptedAgent, channel, client, hear_bytes, open_socket, say
from tests.support.postgres import PostgresServer
from tests.support.viewer import records

PLANT = "std_msgs/msg/String"


@dataclass(frozen=True)
class Pair:
    """Both of them."""

    one: Ready
    two: Ready


@pytest.fixture
async def pair(tmp_path: Path, postgres: PostgresServer) -> AsyncIterator[Pair]:
    """Two gateways that have met."""
    async with gateways(tmp_path, postgres, {}, {}) as (one, two):
        yield Pair(one, two)


async def until(check: Callable[[], Awaitable[bool]], *, timeout_s: float = 30.0) -> None:
    """Ask until it is so."""
    async with asyncio.timeout(timeout_s):
        while True:
            if await check():
                return
            await asyncio.sleep(0.05)


@asynccontextmanager
async def linked(ready: Ready, other: Ready, *, number: int = 1) -> AsyncIterator[ScriptedAgent]:
    """An agent at one, known at the other."""
    async with ScriptedAgent(ready, number=number) as agent, agent.beating(), client(other) as http:
        await agent.announce(channel(1, "/sim_1/chatter", PLANT))

        async def known() -> bool:
            answer = await http.get("/api/v1/robots/sim_1/topics")
            return answer.status_code == 200 and "/sim_1/chatter" in answer.text

        await until(known)
        yield agent


async def test_a_robot_is_seen_at_the_other_gateway(pair: Pair) -> None:
    async with linked(pair.one, pair.two) as agent, client(pair.two) as http:
        assert (await http.get("/api/v1/robots/sim_1")).json()["state"] == "online"
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
            return bool((await http.get("/api/v1/robots/sim_1")).json()["state"] == "offline")

        await until(gone)


async def test_a_command_goes_by_the_other_gateway(pair: Pair) -> None:
    async with linked(pair.one, pair.two) as agent, client(pair.two) as http:

        async def answer() -> None:
            command = (await agent.next("command")).command
            assert command.WhichOneof("action") == "call_service"
            await agent.answer(command, code="unreachable")

        answering = asyncio.create_task(answer())
        body = {"kind": "call_service", "request": {"service": "/sim_1/do", "type": "std_srvs/srv/Trigger"}}
        said = await http.post("/api/v1/robots/sim_1/commands", json=body)
        await answering
        assert said.status_code in (200, 201), said.text
        assert said.json()["state"] == "failed"
        assert said.json()["code"] == "unreachable"
