"""An agent's session, its queues on a disk in memory, and a small gateway half, all in one thread."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections.abc import Sequence

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import METRIC_STREAM, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.sample_trace import Tracer
from edge_agent.link.budget import Budget
from edge_agent.uplink.lane import Compression
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import LANES, AgentSession, Established, Event, Identity
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.idl import type_hash
from metaros.limits import Limits
from tests.edge_agent.parts import accept, make_outbox, policies
from tests.support.gateways.gateway_half import GatewayHalf
from tests.support.simulation.sim_disk import SimDisk

__all__ = ["BATTERY", "EPOCH", "TOPICS", "SessionRig"]

BATTERY = "sensor_msgs/msg/BatteryState"
TABLE = TopicTable(
    [
        TopicRule(match="/event/*", delivery="event"),
        TopicRule(match="/bulk/*", delivery="bulk"),
        TopicRule(match="/live/*", delivery="live"),
        TopicRule(match="/battery_state", delivery="live", fields=("percentage",)),
    ]
)
TOPICS = ("/event/a", "/bulk/a", "/bulk/b", "/live/a", "/battery_state")
EPOCH = make_outbox().live_epoch
WHO = Identity(robot_id="r", session_id=bytes(16), agent_version="0", namespace="/", hostname="h", labels={"site": "x"})


class SessionRig:
    """An agent's queues, its sessions, and a gateway."""

    def __init__(self, gateway: GatewayHalf | None = None, **quotas: int) -> None:
        self.clock = ManualClock()
        self.disk = SimDisk(random.Random(1))
        self.gateway = gateway or GatewayHalf()
        self.outbox = make_outbox(self.disk, self.clock, classes=policies(**quotas))
        self.channels = Channels(TABLE, self.outbox.ids, namespace="/")
        for topic in TOPICS:
            self.channels.observe(topic, BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
        self.live, self.linger = LiveQueue(), Linger()
        self.budget = Budget(now_s=self.clock.monotonic_s())
        self.number, self.store_id = 100, ""
        self.limits = Limits()
        self.compression: Compression = "none"
        self.tracer: Tracer | None = None
        self.session = self.new_session()

    @property
    def queues(self) -> Queues:
        return Queues(self.channels, self.outbox, self.live, self.linger, self.budget, tracer=self.tracer)

    @property
    def epoch(self) -> int:
        return self.outbox.live_epoch

    def new_session(self) -> AgentSession:
        self.number += 1
        self.outbox.online = False
        self.session = AgentSession(
            WHO,
            self.number,
            self.queues,
            clock=self.clock,
            limits=self.limits,
            store_id=self.store_id,
            compression=self.compression,
        )
        self.gateway.connect()
        return self.session

    def connect(self, lanes: Sequence[link_pb2.Lane] = LANES) -> list[Event]:
        events: list[Event] = []
        for lane in lanes:
            self.gateway.receive(lane, self.session.hello(lane))
            events += self.deliver()
        self.store_id = self.session.store_id
        return events

    def deliver(self) -> list[Event]:
        """Everything that the gateway sent reaches the agent."""
        events: list[Event] = []
        for lane, frames in self.gateway.out.items():
            while frames:
                events += self.session.receive(lane, frames.pop(0))
        if any(isinstance(event, Established) for event in events):
            self.outbox.online = True
        return events

    def send(self, limit: int = 10_000, *, lanes: Sequence[link_pb2.Lane] = LANES) -> int:
        """What the agent has to say reaches the gateway; how many frames."""
        accept(self.outbox)
        count = 0
        for lane in lanes:
            while count < limit and (frame := self.session.next_frame(lane)) is not None:
                assert len(frame) <= Limits().frame_bytes
                self.gateway.receive(lane, link_pb2.AgentFrame.FromString(frame))
                count += 1
        return count

    def put(self, topic: str, data: bytes, delivery: str) -> None:
        channel_id = TOPICS.index(topic) + 1
        if delivery == "live":
            channel = self.channels.by_id(channel_id)
            assert channel is not None
            self.live.append(channel, 7, data)
            self.linger.add(len(data), self.clock.monotonic_s())
        else:
            self.outbox.append(channel_id, delivery, 7, data)

    def row(self, value: float) -> None:
        self.outbox.append(METRIC_STREAM, "metric", 7, (1, value))

    def waiting(self) -> int:
        """Durable samples that the gateway has not acknowledged."""
        accept(self.outbox)
        return sum(self.outbox.depth(name).samples for name in ("event", "metric", "bulk"))

    def settle(self) -> None:
        """Until neither side has anything to say."""
        for _ in range(10_000):
            self.clock.advance(0.01)
            sent = self.send()
            self.gateway.ack()
            if not sent and not self.deliver() and not self.waiting():
                return
        raise AssertionError("never settles")
