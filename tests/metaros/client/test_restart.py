"""Programs outlive a gateway: what they read goes on when it is back, what they did is not done twice."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, aclosing
from pathlib import Path
from typing import Any

import grpc
import grpc.aio
import pytest

from gateway.main import Ready
from metaros._proto import telemetry_pb2, telemetry_pb2_grpc
from metaros.client import AsyncClient, Client
from metaros.client.retries import Retries
from metaros.errors import MetarosError, RefusedError, UnavailableError
from tests.gateway.harness import ScriptedAgent, channel, running_gateway
from tests.metaros.client.test_clients import FIBONACCI, KEY, STRING, TRIGGER, text
from tests.support.waiting import wait_until_async

QUICK = Retries(attempts=2, first_s=0.01, most_s=0.2)  # a stream that had these alone would be over before it is back


async def gateway(stack: AsyncExitStack, folder: Path, **ports: int) -> tuple[Ready, ScriptedAgent]:
    """One with its robot, until the stack is closed."""
    ready = await stack.enter_async_context(running_gateway(folder, drain_s=0.0, **ports))
    agent = await stack.enter_async_context(ScriptedAgent(ready))
    await agent.announce(channel(1, "/sim_1/chatter", STRING))
    return ready, agent


def ports_of(ready: Ready) -> dict[str, int]:
    """For the gateway that comes back."""
    http = int(ready.url.rpartition(":")[2])
    return {"port": http, "grpc_port": ready.grpc_port, "api_grpc_port": ready.api_grpc_port}


class Reader:
    """What somebody has read of the robot's topic, and of the fleet's events."""

    def __init__(self) -> None:
        self.seqs: list[int] = []
        self.kinds: list[str] = []  # of events of that robot
        self.watching = False  # an event of another has come

    def begin(self, client: AsyncClient | Client) -> list[asyncio.Task[None]]:
        """Both, in tasks, or in threads."""
        if isinstance(client, AsyncClient):
            reading = self._await(client.subscribe("chatter"), self.seqs), self._await(client.events(), self.kinds)
            return [asyncio.create_task(one) for one in reading]
        following = (client.subscribe("chatter"), self.seqs), (client.events(), self.kinds)
        return [asyncio.create_task(asyncio.to_thread(self._block, *one)) for one in following]

    def took(self, item: Any, found: list[Any]) -> None:
        """One more."""
        if item.robot != "sim_1":
            self.watching = True
        else:
            found.append(getattr(item, "seq", None) or item.kind)

    async def _await(self, items: AsyncIterator[Any], found: list[Any]) -> None:
        async for item in items:
            self.took(item, found)

    def _block(self, items: Iterator[Any], found: list[Any]) -> None:
        try:
            for item in items:
                self.took(item, found)
        except MetarosError:
            pass  # the client was closed


async def test_what_is_read_goes_on_over_a_restart(tmp_path: Path) -> None:
    readers, numbers, sessions = [Reader(), Reader()], itertools.count(1), itertools.count(1)

    async def until_received(agent: ScriptedAgent, tasks: list[asyncio.Task[None]]) -> None:
        first = next(numbers)
        await agent.samples(1, first, [text(first)])
        async with asyncio.timeout(60):
            while not all(reader.seqs and reader.seqs[-1] > first for reader in readers):
                assert not any(task.done() for task in tasks), tasks
                seq = next(numbers)
                await agent.samples(1, seq, [text(seq)])
                await asyncio.sleep(0.02)

    async with AsyncExitStack() as first, AsyncExitStack() as second, AsyncExitStack() as clients:
        ready, agent = await gateway(first, tmp_path)
        aio, sync = AsyncClient(ready.url, key=KEY, retries=QUICK), Client(ready.url, key=KEY, retries=QUICK)
        tasks = [task for reader, one in zip(readers, (aio, sync), strict=True) for task in reader.begin(one)]
        clients.push_async_callback(ended, tasks)
        clients.push_async_callback(asyncio.to_thread, sync.close)
        clients.push_async_callback(aio.close)
        await until_received(agent, tasks)
        async with asyncio.timeout(60):
            while not all(reader.watching for reader in readers):
                async with ScriptedAgent(ready, "sim_2", number=next(sessions)):
                    pass
        await first.aclose()
        _, agent = await gateway(second, tmp_path, **ports_of(ready))
        await until_received(agent, tasks)
        await wait_until_async(lambda: all(reader.kinds[-2:-1] == ["robot.offline"] for reader in readers))
        for reader in readers:
            assert reader.kinds[-2:] == ["robot.offline", "robot.online"], "none is missing"
            assert reader.seqs == sorted(set(reader.seqs)), "a hole, and nothing twice"


class BreaksOff(telemetry_pb2_grpc.TelemetryServiceServicer):
    """A gateway's end, as some of its calls see it."""

    async def Subscribe(self, request: Any, context: Any) -> AsyncIterator[telemetry_pb2.SubscribeReply]:
        yield telemetry_pb2.SubscribeReply(values=[telemetry_pb2.SeriesValues(robot="sim_1")])
        await context.abort(grpc.StatusCode.CANCELLED, "CANCELLED")


async def test_a_stream_that_the_gateway_breaks_off_is_begun_again() -> None:
    server = grpc.aio.server()
    telemetry_pb2_grpc.add_TelemetryServiceServicer_to_server(BreaksOff(), server)
    target = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    await server.start()
    options: dict[str, Any] = {"key": KEY, "grpc_target": target, "retries": QUICK}
    try:
        async with AsyncClient("http://127.0.0.1", **options) as aio, aclosing(aio.subscribe(series="*")) as items:
            assert [(await anext(items)).robot for _ in range(3)] == ["sim_1"] * 3
        with Client("http://127.0.0.1", **options) as sync:
            items_of_sync = sync.subscribe(series="*")
            assert [(await asyncio.to_thread(next, items_of_sync)).robot for _ in range(3)] == ["sim_1"] * 3
        with pytest.raises(UnavailableError):
            next(items_of_sync)
    finally:
        await server.stop(None)


async def ended(tasks: list[asyncio.Task[None]]) -> None:
    """Whatever they end with."""
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def test_what_was_under_way_is_not_done_twice(tmp_path: Path) -> None:
    def verbs(client: AsyncClient | Client) -> list[Any]:
        goal: dict[str, Any] = {"goal": {"order": 1}, "type_name": FIBONACCI}
        return [
            lambda: client.publish("sim_1", "chatter", {"data": "once"}, type_name=STRING),
            lambda: client.call("sim_1", "reset", type_name=TRIGGER),
            lambda: client.send_goal("sim_1", "fibonacci", **goal),
        ]

    async with AsyncExitStack() as first, AsyncExitStack() as second, AsyncExitStack() as clients:
        ready, agent = await gateway(first, tmp_path)
        aio, sync = AsyncClient(ready.url, key=KEY), Client(ready.url, key=KEY)
        clients.push_async_callback(asyncio.to_thread, sync.close)
        clients.push_async_callback(aio.close)
        asking = [asyncio.ensure_future(verb()) for verb in verbs(aio)]
        asking += [asyncio.ensure_future(asyncio.to_thread(verb)) for verb in verbs(sync)]
        for _ in asking:
            await agent.next("command")  # the robot has it, and does not get to answer
        await first.aclose()
        _, agent = await gateway(second, tmp_path, **ports_of(ready))
        ends = await asyncio.gather(*asking, return_exceptions=True)
        assert [end for end in ends if not isinstance(end, UnavailableError | RefusedError)] == []
        marking = asyncio.ensure_future(aio.publish("sim_1", "chatter", {"data": "marker"}, type_name=STRING))
        asked = (await agent.next("command")).command
        assert asked.publish.payload.endswith(b"marker\0"), "nothing came before it"
        await agent.answer(asked)
        await marking
