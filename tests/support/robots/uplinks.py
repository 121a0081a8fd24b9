"""An uplink with an outbox and a session owner of its own: what the tests of transports share."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

from edge_agent.config.gateway_address import parse_address
from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.link.budget import Budget
from edge_agent.link.frames import CommandArrived
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.lane import Compression
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import AgentSession, Established, Event, Identity
from edge_agent.uplink.statistics import LinkFacts
from edge_agent.uplink.uplink import Uplink
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.edge_agent.parts import accept, make_outbox
from tests.support.waiting import wait_until_async

__all__ = ["Owner", "feed", "running", "wait"]

WHO = Identity(robot_id="r", session_id=bytes(16), agent_version="0", namespace="/", hostname="h")
TABLE = TopicTable([TopicRule(match="**", delivery="bulk")])


class Owner:
    """Queues and sessions of a test."""

    def __init__(self, *, store_id: str = "", compression: Compression = "none", robot: str = "r") -> None:
        self.who = replace(WHO, robot_id=robot)
        self.clock = SystemClock()
        self.outbox = make_outbox(clock=self.clock)
        channels = Channels(TABLE, self.outbox.ids, namespace="/")
        self.channel = channels.observe("/a", "a_msgs/msg/A", "RIHS01_00", qos="", keeps_all=True)
        self.queues = Queues(channels, self.outbox, LiveQueue(), Linger(), Budget(now_s=self.clock.monotonic_s()))
        self.facts = LinkFacts()
        self.store_id = store_id
        self.compression = compression
        self.events: list[Event] = []
        self.errors: list[BaseException | None] = []
        self.number = 0

    @property
    def ups(self) -> int:
        """How many sessions were established."""
        return sum(isinstance(event, Established) for event in self.events)

    @property
    def held(self) -> int:
        """Samples that are not acknowledged."""
        return self.outbox.depth("bulk").samples

    def new_session(self) -> AgentSession:
        """The next session."""
        self.number += 1
        return AgentSession(
            self.who,
            self.number,
            self.queues,
            clock=self.clock,
            store_id=self.store_id,
            compression=self.compression,
            facts=self.facts,
        )

    def handle(self, session: AgentSession, event: Event) -> None:
        """Commands are answered at once."""
        self.events.append(event)
        if isinstance(event, CommandArrived):
            session.answer(link_pb2.CommandResult(command_id=event.command.command_id, ok=True))
        elif isinstance(event, Established):
            self.store_id = event.store_id
            self.outbox.online = True

    def session_ended(self, error: BaseException | None = None) -> None:
        """Note it."""
        self.errors.append(error)
        self.outbox.online = False
        if getattr(error, "reason", "") == "forked":
            self.outbox.relabel()


@asynccontextmanager
async def running(*gateways: str, owner: Owner | None = None, **options: Any) -> AsyncIterator[tuple[Owner, Uplink]]:
    """An uplink at work to the gateways of these addresses; it tries again sooner than an agent does."""
    owner = owner or Owner()
    backoff = Backoff(random.Random(1), first_s=0.01, cap_s=0.1)
    uplink = Uplink([parse_address(text) for text in gateways], owner, backoff, owner.clock, **options)
    task = asyncio.create_task(uplink.run())
    try:
        yield owner, uplink
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def feed(owner: Owner, uplink: Uplink, payloads: list[bytes]) -> None:
    """Accept bulk samples, on disk at once."""
    for payload in payloads:
        owner.outbox.append(owner.channel.channel_id, "bulk", 0, payload)
    accept(owner.outbox)
    uplink.wake()


async def wait(condition: Callable[[], object], *, timeout_s: float = 60.0) -> None:
    """Until it is so, also on a machine that does many other things."""
    await wait_until_async(condition, timeout_s=timeout_s)
