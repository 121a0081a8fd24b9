"""The agent's half of the simulated world: its real outbox, session, channels and live queue on a simulated disk."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.errors import DiskError, LinkError, RefusedError
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.link.budget import Budget
from edge_agent.outbox import LOGS, ClassPolicy, Outbox, run_steps, steps
from edge_agent.outbox.outbox import FlushJob
from edge_agent.outbox.pending import Lost
from edge_agent.outbox.state import OutboxState
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import LANES, AgentSession, Established, Identity
from metaros.idl import type_hash
from metaros.limits import Limits
from tests.support.simulation.sim_disk import Crash, SimDisk
from tests.support.simulation.sim_gateway import Key, Link

if TYPE_CHECKING:
    from tests.support.simulation.link_sim import LinkSimulation

__all__ = ["CLASSES", "LIMITS", "Agent", "Ledger", "WatchedOutbox"]

KIB = 1024
TYPE, BATTERY = "std_msgs/msg/String", "sensor_msgs/msg/BatteryState"
LIMITS = Limits(
    batch_bytes=2 * KIB,
    chunk_bytes=2 * KIB,
    batch_samples=8,
    window_batches=6,
    window_bytes=16 * KIB,
    outbox_segment_bytes=5 * KIB,
    heartbeat_s=0.3,
    dead_after_s=1.0,
)
TOPICS = ("/events", "/bulk_a", "/bulk_b")
TABLE = TopicTable(
    [
        TopicRule(match="/events", delivery="event"),
        TopicRule(match="/video", delivery="live"),
        TopicRule(match="/battery", delivery="live", fields=("percentage",)),
        TopicRule(match="**", delivery="bulk"),
    ]
)
CLASSES = {
    "event": ClassPolicy(quota_bytes=60 * KIB, when_full="refuse", sync_s=0.0, sync_bytes=1),
    "metric": ClassPolicy(quota_bytes=4 * KIB, when_full="thin", sync_s=0.0, sync_bytes=1),
    "bulk": ClassPolicy(quota_bytes=50 * KIB, when_full="drop", sync_s=0.0, sync_bytes=1),
}
SEGMENTS = {"metric": 700, "metric_backfill": 700}  # small ones, so that thinning has some to choose from
Place = tuple[int, int, int]  # era, stream, seq


@dataclass
class Ledger:
    """What one life of an outbox directory has accepted, and under which epochs it has been."""

    places: dict[int, Place] = field(default_factory=dict)  # stamp ->
    newest: dict[tuple[int, int], int] = field(default_factory=dict)  # (era, stream) -> last number accepted
    epochs: dict[int, list[tuple[int, Mapping[int, int]]]] = field(default_factory=dict)  # era -> epoch, bases
    cut: dict[tuple[int, int], int] = field(default_factory=dict)  # where recovery ended an era, if before `newest`

    def copy(self) -> Ledger:
        """For a copy of the directory."""
        epochs = {era: list(known) for era, known in self.epochs.items()}
        return Ledger(dict(self.places), dict(self.newest), epochs, dict(self.cut))

    def label(self, state: OutboxState) -> None:
        """The directory goes by this state from now on."""
        for era, epoch in state.epochs.items():
            known = self.epochs.setdefault(era, [])
            if not known or known[-1][0] != epoch:
                known.append((epoch, dict(state.bases.get(era, {}))))

    def accept(self, job: FlushJob, era: int, before: Mapping[int, int]) -> None:
        """A flush is done: its samples have these numbers."""
        for stream, queue in job.streams.items():
            seq = before.get(stream, 0)
            for item in queue:
                if isinstance(item, Lost):
                    seq += item.count
                else:
                    seq += 1
                    self.places[item[0]] = (era, stream, seq)
            self.newest[era, stream] = seq

    def opened(self, last: Mapping[int, Mapping[int, int]], acked_eras: set[int]) -> None:
        """A process has begun, and read these newest numbers."""
        for (era, stream), seq in self.newest.items():
            if era not in acked_eras and last.get(era, {}).get(stream, 0) < seq:
                self.cut[era, stream] = last.get(era, {}).get(stream, 0)

    def final(self, place: Place) -> Key:
        """The identity's stream and epoch that a number has in the end."""
        era, stream, seq = place
        epochs = [epoch for epoch, bases in self.epochs[era] if bases.get(stream, 0) < seq]
        return stream, epochs[-1]


class WatchedOutbox(Outbox):
    """An outbox whose every step is noted in a ledger."""

    def __init__(self, ledger: Ledger, *args: Any, **more: Any) -> None:
        self.ledger = ledger
        super().__init__(*args, **more)
        gone = {era for era, _ in ledger.newest} - {era for log in self.logs.values() for era, _ in log.streams()}
        ledger.opened(self._last(), gone)

    def flushed(self, job: FlushJob) -> None:
        """It was run: its samples are accepted."""
        before = dict(self.logs[job.log].last)
        super().flushed(job)
        self.ledger.accept(job, self.state.era, before)

    def _save(self, state: OutboxState) -> None:
        super()._save(state)
        self.ledger.label(state)

    def _segment_bytes(self, name: str) -> int:
        return SEGMENTS.get(name, super()._segment_bytes(name))


class Agent:
    """One process on one disk; `start` after `crash` is the next process."""

    outbox_type: type[WatchedOutbox] = WatchedOutbox

    def __init__(self, world: LinkSimulation, disk: SimDisk, name: str, ledger: Ledger) -> None:
        self.world = world
        self.disk = disk
        self.name = name
        self.ledger = ledger
        self.session: AgentSession | None = None
        self.link: Link | None = None
        self.channels: dict[str, int] = {}
        self.retry_s = 0.0
        self.start()

    def start(self) -> None:
        """The process begins; it waits for a disk that works."""
        world, self.retry_s = self.world, 0.0
        while True:
            try:
                self.outbox = self.outbox_type(
                    self.ledger,
                    self.disk,
                    world.clock,
                    new_epoch=lambda: world.rng.getrandbits(64),
                    writer=f"{world.rng.getrandbits(64):016x}",
                    classes=CLASSES,
                    reserve_bytes=8 * KIB,
                    limits=LIMITS,
                )
                break
            except Crash:
                self.disk.crash_in = None
            except DiskError:
                self.disk.repair()
        channels = Channels(TABLE, self.outbox.ids, namespace="/", limits=LIMITS)
        self.queues = Queues(channels, self.outbox, LiveQueue(), Linger(), Budget(now_s=world.clock.monotonic_s()))
        for topic in TOPICS:
            self.channels[topic] = self.observe(topic, TYPE).channel_id
        self.video = self.observe("/video", TYPE)
        self.observe("/battery", BATTERY)
        self.series = self.outbox.ids.series["battery.percentage"].series

    def observe(self, topic: str, type_name: str) -> Channel:
        """A topic of the robot."""
        channel = self.queues.channels.observe(topic, type_name, type_hash(type_name), qos="", keeps_all=False)
        assert channel is not None
        return channel

    def produce(self, count: int) -> None:
        """Samples from the robot's nodes; each has a stamp of its own, by which it is known."""
        rng = self.world.rng
        for _ in range(count):
            stamp, kind = self.world.next_stamp(), int(rng.random() * 5)
            if kind == 3:
                self.outbox.append(0, "metric", stamp, (self.series, 0.5))
            elif kind == 4:
                self.queues.live.append(self.video, stamp, b"frame")
                self.queues.linger.add(5, self.world.clock.monotonic_s())
            else:
                size = (8, 8, 300, 1000, 5000)[int(rng.random() * 5)]
                self.outbox.append(self.channels[TOPICS[kind]], "bulk" if kind else "event", stamp, bytes(size))

    def flush(self) -> None:
        """What is due goes to the disk."""
        for name in LOGS:
            if self.outbox.due_s(name) == 0.0:
                run_steps(steps(self.outbox, self.disk, name))

    def connect(self) -> None:
        """A new session on a new link, if it is time for one."""
        if self.session is not None or self.world.clock.monotonic_s() < self.retry_s:
            return
        who = Identity(robot_id="r", session_id=bytes(16), agent_version="", namespace="/", hostname=self.name)
        number = self.world.next_session()
        self.session = AgentSession(who, number, self.queues, clock=self.world.clock, limits=LIMITS)
        self.link = self.world.new_link(self)
        for lane in LANES:
            self.link.up[lane].append(self.session.hello(lane).SerializeToString())

    def pump(self, lane: int, count: int) -> None:
        """Write to a lane what the session has for it."""
        if self.session is None or self.link is None:
            return
        for _ in range(count):
            frame = self.session.next_frame(lane)
            if frame is None:
                return
            if not self.link.lost:
                self.link.up[lane].append(frame)

    def hear(self, lane: int) -> None:
        """One frame of the gateway, if there is one."""
        if self.session is None or self.link is None or not self.link.down[lane]:
            return
        frame = self.link.down[lane].popleft()
        try:
            for event in self.session.receive(lane, frame):
                if isinstance(event, Established):
                    self.outbox.online = True
        except RefusedError as error:
            self.ended(forked=error.reason == "forked")
            self.retry_s = self.world.clock.monotonic_s() + 0.01
        except (LinkError, DiskError):
            self.ended()

    def check(self) -> None:
        """Whether the gateway has been silent for too long."""
        if self.session is not None:
            try:
                self.session.check()
            except LinkError:
                self.ended()

    def ended(self, *, forked: bool = False) -> None:
        """The session is over on this side."""
        self.session, self.link = None, None
        self.outbox.online = False
        self.queues.live.clear()
        if forked:
            with contextlib.suppress(DiskError):  # it will be forked again
                self.outbox.relabel()

    @property
    def drained(self) -> bool:
        """Whether everything held has arrived."""
        return self.outbox.online and not any(self.outbox.depth(name).samples for name in CLASSES)
