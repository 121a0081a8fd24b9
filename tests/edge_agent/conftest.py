"""An agent on a real router, against a small gateway in process, and a robot's node beside it."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import metaros
from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.support.gateways.fake_gateway import FakeGateway, fake_gateway
from tests.support.gateways.gateway_half import GatewayHalf
from tests.support.waiting import wait_until_async


@dataclass
class Robot:
    """A node /sim_1/base with a spinning executor."""

    context: metaros.Context
    node: metaros.Node

    def other(self, name: str, namespace: str) -> metaros.Node:
        """One more node of the same program."""
        return metaros.Node(name, namespace=namespace, context=self.context)


@pytest.fixture
def robot(zenoh_router: str) -> Iterator[Robot]:
    with metaros.Context(connect=zenoh_router) as context:
        node = metaros.Node("base", namespace="/sim_1", context=context)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        try:
            yield Robot(context, node)
        finally:
            executor.shutdown()
            thread.join(60)


@dataclass
class Rig:
    """The gateway that a running agent is connected to."""

    gateway: FakeGateway
    ids: Iterator[int] = field(default_factory=itertools.count)

    @property
    def half(self) -> GatewayHalf:
        """What the gateway was told."""
        return self.gateway.half

    def channel(self, topic: str) -> link_pb2.Channel | None:
        """The announced channel of a topic."""
        return next((c for c in self.half.channels.values() if c.topic == topic), None)

    async def wait_channel(self, topic: str) -> link_pb2.Channel:
        """The same, once it is there."""
        await wait_until_async(lambda: self.channel(topic) is not None)
        channel = self.channel(topic)
        assert channel is not None
        return channel

    def command(self, **action: object) -> bytes:
        """Send a command; its id."""
        command_id = next(self.ids).to_bytes(16, "big")
        stamped = {"timeout_ms": 30_000, "sent_ns": SystemClock().wall_ns(), **action}
        command = link_pb2.Command(command_id=command_id, **stamped)  # type: ignore[arg-type]
        self.gateway.say(link_pb2.GatewayFrame(command=command))
        return command_id

    async def result(self, command_id: bytes) -> link_pb2.CommandResult:
        """The result of a command."""
        found: list[link_pb2.CommandResult] = []
        await wait_until_async(
            lambda: found.extend(r for r in self.half.results if r.command_id == command_id) or found
        )
        return found[0]

    def demand(self, channel: link_pb2.Channel, rate_hz: float = 0.0) -> None:
        """A viewer wants the channel."""
        entry = link_pb2.DemandEntry(channel_id=channel.channel_id, max_rate_hz=rate_hz)
        self.gateway.say(link_pb2.GatewayFrame(demand=link_pb2.Demand(revision=1, entries=[entry])))


@pytest.fixture
async def gateway(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[FakeGateway]:
    """Whose agents say how they are twenty times a second."""
    monkeypatch.setattr("edge_agent.uplink.session.STATISTICS_S", 0.05)
    async with fake_gateway() as gateway:
        yield gateway


@pytest.fixture
async def agent(zenoh_router: str, gateway: FakeGateway, tmp_path: Path) -> AsyncIterator[Rig]:
    """The agent of /sim_1, connected."""
    port = int(zenoh_router.rpartition(":")[2])
    settings = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=port,
        host_metrics=False,
        state_dir=tmp_path / "agent",
    )
    task = asyncio.create_task(run_agent(settings))
    try:
        await wait_until_async(lambda: gateway.connected or task.done())
        assert not task.done(), task.exception()
        yield Rig(gateway)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
