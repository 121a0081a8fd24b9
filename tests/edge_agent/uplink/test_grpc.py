"""The gRPC shell against a real server in process: it connects, carries, notices loss and comes back."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from edge_agent.batch import Linger
from edge_agent.channels import Channels
from edge_agent.live import LiveQueue
from edge_agent.outbox import Outbox
from edge_agent.topics import TopicRule, TopicTable
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.grpc import GrpcUplink
from edge_agent.uplink.session import AgentSession, CommandArrived, Event, Identity
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.support.fake_gateway import DATA, FakeGateway, fake_gateway
from tests.support.gateway_half import GatewayHalf
from tests.support.waiting import wait_until_async

WHO = Identity(robot_id="r", session_id=bytes(16), agent_version="0", namespace="/", hostname="h")
TABLE = TopicTable([TopicRule(match="**", delivery="bulk")])


class Owner:
    """Queues and sessions of a test."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.channels = Channels(TABLE, namespace="/")
        self.channels.observe("/a", "a_msgs/msg/A", "RIHS01_00", qos="", keeps_all=True)
        self.outbox, self.live, self.linger = Outbox(self.clock, 7), LiveQueue(), Linger()
        self.events: list[Event] = []
        self.ended = 0
        self.number = 0

    def new_session(self) -> AgentSession:
        self.number += 1
        return AgentSession(
            WHO,
            self.number,
            channels=self.channels,
            outbox=self.outbox,
            live=self.live,
            linger=self.linger,
            clock=self.clock,
        )

    def handle(self, session: AgentSession, event: Event) -> None:
        self.events.append(event)
        if isinstance(event, CommandArrived):
            session.answer(link_pb2.CommandResult(command_id=event.command.command_id, ok=True))

    def session_ended(self) -> None:
        self.ended += 1


@asynccontextmanager
async def running(target: str) -> AsyncIterator[tuple[Owner, GrpcUplink]]:
    owner = Owner()
    uplink = GrpcUplink(target, owner, Backoff(random.Random(1)))
    task = asyncio.create_task(uplink.run())
    try:
        yield owner, uplink
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def feed(owner: Owner, uplink: GrpcUplink, payloads: list[bytes]) -> None:
    for payload in payloads:
        owner.outbox.append(1, "bulk", 0, payload)
    owner.linger.add(sum(map(len, payloads)), owner.clock.monotonic_s())
    uplink.wake()


async def test_samples_arrive_and_are_acknowledged() -> None:
    async with fake_gateway() as gateway, running(gateway.target) as (owner, uplink):
        payloads = [bytes([i]) * 100 for i in range(100)]
        feed(owner, uplink, payloads)
        await wait_until_async(lambda: len(gateway.half.rows[1]) == 100 and owner.outbox.sample_count == 0)
        assert list(gateway.half.rows[1].values()) == payloads


async def test_commands_are_answered() -> None:
    async with fake_gateway() as gateway, running(gateway.target):
        await wait_until_async(lambda: gateway.connected)
        gateway.say(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16)))
        await wait_until_async(lambda: gateway.half.results)
        assert gateway.half.results[0].command_id == b"c" * 16


async def test_it_comes_back_after_the_gateway_and_loses_nothing() -> None:
    async with fake_gateway() as gateway, running(gateway.target) as (owner, uplink):
        gateway.acks = False
        feed(owner, uplink, [b"before"])
        await wait_until_async(lambda: gateway.half.rows[1])
        await gateway.stop()
        await wait_until_async(lambda: owner.ended >= 1)
        feed(owner, uplink, [b"meanwhile"])
        await gateway.start()
        gateway.acks = True
        await wait_until_async(lambda: len(gateway.half.rows[1]) == 2 and owner.outbox.sample_count == 0)
        assert gateway.half.rows[1] == {1: b"before", 2: b"meanwhile"}
        assert gateway.half.duplicates == 0


async def test_it_waits_for_a_gateway_that_is_not_there_yet() -> None:
    gateway = FakeGateway()
    async with running(gateway.target) as (owner, _uplink):
        await wait_until_async(lambda: owner.ended >= 3)
        await gateway.start()
        await wait_until_async(lambda: gateway.connected, timeout_s=60)
        await gateway.stop()


async def test_a_goodbye_says_when_to_come_back() -> None:
    async with fake_gateway() as gateway, running(gateway.target) as (owner, _uplink):
        await wait_until_async(lambda: gateway.connected)
        goodbye = link_pb2.Goodbye(code="shutting_down", retry_after_ms=500)
        said = time.monotonic()
        gateway.say(link_pb2.GatewayFrame(goodbye=goodbye), lane=DATA)
        await wait_until_async(lambda: owner.ended == 1 and owner.number == 2)
        assert time.monotonic() - said >= 0.45


async def test_the_end_comes_even_while_a_session_fails() -> None:
    for _ in range(20):
        async with fake_gateway() as gateway:
            owner = Owner()
            task = asyncio.create_task(GrpcUplink(gateway.target, owner, Backoff(random.Random(1))).run())
            await wait_until_async(lambda g=gateway: g.connected)  # type: ignore[misc]
            stopping = asyncio.create_task(gateway.stop())
            await asyncio.sleep(0)
            task.cancel()
            await asyncio.wait_for(asyncio.gather(task, return_exceptions=True), 30)
            assert owner.ended == 1
            await stopping
            await gateway.start()


async def test_control_answers_while_data_is_flooded() -> None:
    half = GatewayHalf(window_bytes=1 << 40, window_batches=1 << 30)
    async with fake_gateway(half) as gateway, running(gateway.target) as (owner, uplink):
        await wait_until_async(lambda: gateway.connected)
        feed(owner, uplink, [bytes(1 << 20)] * 40)
        gateway.say(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16)))
        await wait_until_async(lambda: half.results)
        await wait_until_async(lambda: len(half.rows[1]) == 40, timeout_s=60)
