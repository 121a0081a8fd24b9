"""A seeded world for the delivery contract: real agent and gateway halves, and everything between them made to fail.

The agent is its outbox on a simulated disk and its session; the gateway is its session and stream table before a
small store with the engine's one promise, that a commit is all or nothing. Frames travel through queues that can be
cut at any moment. Nothing here waits, and nothing is random but by the seed.
"""

from __future__ import annotations

import contextlib
import random  # noqa: TID251 - seeded, one a world
from collections import deque
from dataclasses import dataclass, field

from edge_agent.batch import Linger
from edge_agent.channels import Channels
from edge_agent.errors import DiskError, LinkError, RefusedError
from edge_agent.live import LiveQueue
from edge_agent.outbox import LOGS, ClassPolicy, Disk, Outbox, run_steps, steps
from edge_agent.topics import TopicRule, TopicTable
from edge_agent.uplink.budget import Budget
from edge_agent.uplink.session import LANES, AgentSession, Established, Identity, Queues
from gateway.errors import FencedError, LinkError as GatewayLinkError
from gateway.ingest.events import Arrived, Closed, GapDeclared, RowsArrived, Send, WriterKnown
from gateway.ingest.session import Session
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.errors import FrameError
from metaros.idl import type_hash
from metaros.limits import Limits
from tests.support.sim_disk import Crash, SimDisk

__all__ = ["Agent", "Gateway", "Identity_", "SimStore", "World"]

KIB = 1024
TYPE = "std_msgs/msg/String"
LIMITS = Limits(batch_bytes=8 * KIB, chunk_bytes=8 * KIB, batch_samples=16, window_batches=6, window_bytes=64 * KIB)
TOPICS = ("/events", "/bulk_a", "/bulk_b")
BATTERY = "sensor_msgs/msg/BatteryState"
TABLE = TopicTable(
    [
        TopicRule(match="/events", delivery="event"),
        TopicRule(match="/battery", delivery="live", fields=("percentage",)),
        TopicRule(match="**", delivery="bulk"),
    ]
)
CLASSES = {
    "event": ClassPolicy(quota_bytes=512 * KIB, when_full="refuse", sync_s=0.0, sync_bytes=1),
    "metric": ClassPolicy(quota_bytes=600 * KIB, when_full="thin", sync_s=0.0, sync_bytes=1),
    "bulk": ClassPolicy(quota_bytes=600 * KIB, when_full="drop", sync_s=0.0, sync_bytes=1),
}
Identity_ = tuple[int, int]  # stream, epoch


@dataclass
class SimStore:
    """What the gateway has for ever: rows by number, gaps, watermarks, writers; a commit is all or nothing."""

    rows: dict[Identity_, dict[int, int]] = field(default_factory=dict)
    gaps: dict[Identity_, set[int]] = field(default_factory=dict)
    marks: dict[Identity_, int] = field(default_factory=dict)
    writers: dict[int, str] = field(default_factory=dict)
    bases: dict[Identity_, int] = field(default_factory=dict)
    works: bool = True

    def commit(self, events: list[object]) -> list[tuple[int, int, int]]:
        """Store what follows its stream's watermark, and nothing else; the watermarks to acknowledge."""
        touched: dict[Identity_, None] = {}
        for event in events:
            if isinstance(event, WriterKnown):
                self.writers.update(event.writers)
                continue
            key, first, last, stamps = described(event)
            touched[key] = None
            mark = self.marks.get(key, self.bases.get(key, 0))
            if first > mark + 1 or last <= mark:
                continue  # what was before it was refused, or it was stored meanwhile
            if stamps is None:
                self.gaps.setdefault(key, set()).update(range(mark + 1, last + 1))
            else:
                rows = self.rows.setdefault(key, {})
                for seq, stamp in enumerate(stamps, first):
                    if seq > mark:
                        assert seq not in rows, f"{key} {seq} twice"
                        rows[seq] = stamp
            self.marks[key] = last
        return [(*key, self.marks[key]) for key in touched if key in self.marks]


def described(event: object) -> tuple[Identity_, int, int, list[int] | None]:
    """A write's stream, its numbers, and its samples' stamps (none for a gap)."""
    if isinstance(event, GapDeclared):
        return (event.stream_id, event.epoch), event.gap.from_seq, event.gap.to_seq, None
    if isinstance(event, RowsArrived):
        stamps = event.rows.stamps.tolist()
        return (event.stream_id, event.epoch), event.seq - len(stamps) + 1, event.seq, stamps
    assert isinstance(event, Arrived)
    columns = event.run.columns
    return (columns.stream_id, event.epoch), columns.first_seq, event.seq, columns.stamps_ns.tolist()


class Gateway:
    """The gateway's half at work: one robot, a queue to the store, sessions that fence one another."""

    def __init__(self, store: SimStore, clock: ManualClock) -> None:
        self.store = store
        self.clock = clock
        self.streams = StreamTable(store.marks, writers=store.writers)
        self.session: Session | None = None
        self.link: Link | None = None
        self.queue: list[object] = []

    def hello(self, link: Link, lane: int, hello: link_pb2.Hello) -> None:
        """A lane's first frame."""
        try:
            if self.session is None or self.session.number != hello.session_number:
                if self.session is not None and hello.session_number < self.session.number:
                    raise FencedError("older")
                if self.streams.forked(hello):
                    link.say(lane, goodbye("forked"))
                    return
                if self.session is not None:
                    self.apply(self.session.close("fenced", "newer"))
                self.session = Session(hello, self.streams, gateway_id="g", store_id="s", limits=LIMITS)
                self.link = link
            for state in hello.streams:
                self.store.bases.setdefault((state.stream_id, state.epoch), state.base_seq)
            self.apply(self.session.open_lane(hello, now_s=self.clock.monotonic_s(), wall_ns=self.clock.wall_ns()))
        except GatewayLinkError as error:
            link.say(lane, goodbye(error.code))

    def receive(self, link: Link, lane: int, data: bytes) -> None:
        """Any later frame."""
        frame = link_pb2.AgentFrame.FromString(data)
        if frame.WhichOneof("frame") == "hello":
            self.hello(link, lane, frame.hello)
        elif self.session is not None and self.link is link:
            if not self.store.works:
                self.apply(self.session.refuse("store_error", retry_after_ms=20))
            now_s, wall_ns = self.clock.monotonic_s(), self.clock.wall_ns()
            self.apply(self.session.receive(lane, frame, now_s=now_s, wall_ns=wall_ns))

    def apply(self, events: list[object]) -> None:
        for event in events:
            if isinstance(event, Send):
                if self.link is not None:
                    self.link.say(event.lane, event.frame)
            elif isinstance(event, Closed):
                self.session, self.link = None, None
            elif isinstance(event, Arrived) and not event.durable:
                continue
            elif isinstance(event, Arrived | RowsArrived | GapDeclared | WriterKnown):
                self.queue.append(event)

    def commit(self, count: int) -> None:
        """One group commit of what waits, or the store's refusal."""
        events, self.queue = self.queue[:count], self.queue[count:]
        if not self.store.works:
            self.queue = [event for event in (*events, *self.queue) if isinstance(event, WriterKnown)]
            self.streams.refuse()
            if self.session is not None:
                self.apply(self.session.refuse("store_error", retry_after_ms=20))
            return
        acks = self.store.commit(events)
        for event in events:
            if isinstance(event, WriterKnown):
                for epoch, writer in event.writers.items():
                    self.streams.commit_writer(epoch, writer)
        for stream, epoch, seq in acks:
            self.streams.commit(stream, epoch, seq)
        if self.session is not None:
            self.apply(self.session.committed(acks))

    def lane_ended(self, link: Link) -> None:
        """The connection is gone, as far as this side can tell."""
        if self.link is link and self.session is not None:
            self.apply(self.session.lane_ended())


@dataclass(eq=False)
class Link:
    """Three lanes of frames under way."""

    up: dict[int, deque[bytes]] = field(default_factory=lambda: {lane: deque() for lane in LANES})
    down: dict[int, deque[link_pb2.GatewayFrame]] = field(default_factory=lambda: {lane: deque() for lane in LANES})
    cut: bool = False

    def say(self, lane: int, frame: link_pb2.GatewayFrame) -> None:
        """A frame of the gateway."""
        if not self.cut:
            self.down[lane].append(frame)


class Agent:
    """The agent's half at work on one disk."""

    def __init__(self, world: World, disk: SimDisk, name: str) -> None:
        self.world = world
        self.disk = disk
        self.name = name
        self.session: AgentSession | None = None
        self.link: Link | None = None
        self.outbox: Outbox | None = None
        self.queues: Queues | None = None
        self.accepted: dict[int, set[Identity_]] = {}
        self.channels: dict[str, int] = {}
        self.series = 0

    def start(self) -> None:
        """The process begins; waits for a disk that works."""
        world = self.world
        while self.outbox is None:
            try:
                self.outbox = Outbox(
                    self.disk,
                    world.clock,
                    new_epoch=lambda: world.rng.getrandbits(64),
                    writer=f"{world.rng.getrandbits(64):016x}",
                    classes=CLASSES,
                    reserve_bytes=64 * KIB,
                    limits=LIMITS,
                )
            except Crash:
                self.disk.crash_in = None
            except DiskError:
                self.disk.foreign_bytes, self.disk.size_bytes = 0, 1 << 40
        channels = Channels(TABLE, self.outbox.ids, namespace="/", limits=LIMITS)
        self.queues = Queues(channels, self.outbox, LiveQueue(), Linger(), Budget(now_s=world.clock.monotonic_s()))
        for topic in TOPICS:
            channel = channels.observe(topic, TYPE, type_hash(TYPE), qos="", keeps_all=True)
            assert channel is not None
            self.channels[topic] = channel.channel_id
        channels.observe("/battery", BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
        self.series = self.outbox.ids.series["battery.percentage"].series

    def produce(self, count: int) -> None:
        """Samples from the robot's nodes; each has a stamp of its own, by which it is known."""
        assert self.outbox is not None
        rng = self.world.rng
        for _ in range(count):
            stamp = self.world.next_stamp()
            kind = rng.randrange(4)
            if kind == 3:
                self.outbox.append(0, "metric", stamp, (self.series, 0.5))
            else:
                delivery = "event" if kind == 0 else "bulk"
                size = rng.choice((8, 8, 300, 3000, 20000))
                self.outbox.append(self.channels[TOPICS[kind]], delivery, stamp, bytes(size))

    def flush(self) -> None:
        """Everything gathered goes to the disk; what is accepted is noted from the outbox's own numbers."""
        assert self.outbox is not None
        for name in LOGS:
            run_steps(steps(self.outbox, self.disk, name))
        for held in self.outbox.ranges():
            key = (held.stream_id, held.epoch)
            self.world.accepted[key] = max(self.world.accepted.get(key, 0), held.last_seq)
            self.world.bases[key] = max(self.world.bases.get(key, 0), held.base_seq)

    def connect(self) -> None:
        """A new session on a new link."""
        assert self.queues is not None
        self.world.session_number += 1
        identity = Identity(
            robot_id="r", session_id=self.name.encode().ljust(16, b"."), agent_version="", namespace="/", hostname="h"
        )
        self.session = AgentSession(
            identity, self.world.session_number, self.queues, clock=self.world.clock, limits=LIMITS
        )
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
            self.link.up[lane].append(frame)

    def hear(self, lane: int) -> None:
        """One frame of the gateway, if there is one."""
        if self.session is None or self.link is None or not self.link.down[lane]:
            return
        frame = self.link.down[lane].popleft()
        try:
            for event in self.session.receive(lane, frame):
                if isinstance(event, Established):
                    assert self.outbox is not None
                    self.outbox.online = True
        except RefusedError as error:
            self.ended(forked=error.reason == "forked")
        except (LinkError, DiskError):
            self.ended()

    def ended(self, *, forked: bool = False) -> None:
        """The session is over on this side."""
        self.session, self.link = None, None
        if self.outbox is not None:
            self.outbox.online = False
            if forked:
                with contextlib.suppress(DiskError):  # it will be forked again
                    self.outbox.relabel()

    def crash(self) -> None:
        """The process dies."""
        self.ended()
        self.outbox = self.queues = None


class World:
    """One robot, its gateway, and what happens to them."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.clock = ManualClock()
        self.store = SimStore()
        self.gateway = Gateway(self.store, self.clock)
        self.accepted: dict[Identity_, int] = {}
        self.bases: dict[Identity_, int] = {}
        self.session_number = 0
        self._stamp = 0
        self._links: dict[int, tuple[Agent, Link]] = {}
        disk = SimDisk(self.rng, size_bytes=self.rng.choice((1 << 40, 1 << 40, 900 * KIB)))
        self.agent = Agent(self, disk, "a")
        self.agent.start()

    def next_stamp(self) -> int:
        """A number that no other sample has."""
        self._stamp += 1
        return self._stamp

    def new_link(self, agent: Agent) -> Link:
        """The network carries another connection."""
        link = Link()
        self._links[id(link)] = (agent, link)
        return link

    def cut(self) -> None:
        """Every connection breaks; either side may learn of it only later."""
        for agent, link in self._links.values():
            link.cut = True
            link.up = {lane: deque() for lane in LANES}
            link.down = {lane: deque() for lane in LANES}
            if agent.link is link:
                agent.ended()
            if self.rng.random() < 0.7:
                self.gateway.lane_ended(link)
        self._links.clear()

    def carry(self, count: int) -> None:
        """Frames arrive, lane by lane in order, the lanes in any."""
        for _ in range(count):
            lane = self.rng.choice(LANES)
            for agent, link in list(self._links.values()):
                if link.up[lane]:
                    self.gateway.receive(link, lane, link.up[lane].popleft())
                if agent.link is link:
                    agent.hear(lane)

    def step(self) -> None:
        """One thing happens."""
        acts = (
            ("work", 40),
            ("commit", 14),
            ("cut", 3),
            ("agent_crash", 2),
            ("gateway_crash", 2),
            ("disk_fails", 2),
            ("disk_fills", 2),
            ("store_fails", 2),
            ("time", 4),
            ("jump", 1),
        )
        act = self.rng.choices([name for name, _ in acts], [weight for _, weight in acts])[0]
        getattr(self, act)()

    def work(self) -> None:
        """The usual: samples come, are flushed, sent, and arrive."""
        rng, agent = self.rng, self.agent
        if agent.session is None:
            agent.connect()
        agent.produce(rng.randrange(12))
        if rng.random() < 0.7:
            agent.flush()
        for lane in LANES:
            agent.pump(lane, rng.randrange(4))
        self.carry(rng.randrange(12))
        self.clock.advance(0.003)

    def commit(self) -> None:
        """The gateway commits some of what waits."""
        self.gateway.commit(self.rng.choice((1, 3, 1000)))

    def agent_crash(self) -> None:
        """The agent dies, perhaps inside a write, and starts again on its disk."""
        self.agent.disk.crash_in = self.rng.randrange(6)
        try:
            self.agent.produce(self.rng.randrange(12))
            self.agent.flush()
        except Crash:
            pass
        self.agent.disk.crash_in = None
        self.agent.crash()
        self.cut()
        self.agent.start()

    def gateway_crash(self) -> None:
        """The gateway dies with what it had not committed."""
        self.gateway = Gateway(self.store, self.clock)
        self.cut()

    def disk_fails(self) -> None:
        """One of the agent's next writes fails."""
        self.agent.disk.fail_in = self.rng.randrange(4)

    def disk_fills(self) -> None:
        """Somebody fills the agent's disk, or clears it."""
        disk = self.agent.disk
        disk.foreign_bytes = self.rng.choice((0, max(0, disk.free()[0] - self.rng.randrange(3000))))

    def store_fails(self) -> None:
        """The gateway's disk is full, or works again."""
        self.store.works = not self.store.works

    def time(self) -> None:
        """Time passes: lingers, pauses, heartbeats."""
        self.clock.advance(self.rng.choice((0.02, 0.3, 6.0)))

    def jump(self) -> None:
        """The robot's calendar is set ten years off."""
        self.clock.jump_wall(self.rng.choice((-1, 1)) * 315_000_000)

    def heal(self) -> None:
        """Everything works again, until all that is held has arrived."""
        self.store.works = True
        disk = self.agent.disk
        disk.foreign_bytes, disk.fail_in, disk.size_bytes = 0, None, 1 << 40
        for _ in range(600):
            if self.agent.session is None:
                self.agent.connect()
            self.agent.flush()
            for lane in LANES:
                self.agent.pump(lane, 50)
            self.carry(60)
            self.gateway.commit(1000)
            self.clock.advance(0.05)
            outbox = self.agent.outbox
            assert outbox is not None
            if outbox.online and not any(outbox.depth(name).samples for name in CLASSES):
                return
        raise AssertionError("what is held does not arrive")

    def check(self) -> None:
        """Rows and gaps are all numbers up to the last accepted, disjoint; no sample is stored twice."""
        seen: dict[int, Identity_] = {}
        for key, last in self.accepted.items():
            rows, gaps = self.store.rows.get(key, {}), self.store.gaps.get(key, set())
            assert not rows.keys() & gaps, f"{key}: both stored and lost: {sorted(rows.keys() & gaps)[:5]}"
            missing = set(range(self.bases.get(key, 0) + 1, last + 1)) - rows.keys() - gaps
            assert not missing, f"{key}: {len(missing)} of {last} neither stored nor declared: {sorted(missing)[:5]}"
        for key, rows in self.store.rows.items():
            for stamp in rows.values():
                assert seen.setdefault(stamp, key) == key, f"sample {stamp} stored under {seen[stamp]} and {key}"


def goodbye(code: str) -> link_pb2.GatewayFrame:
    """A refusal."""
    return link_pb2.GatewayFrame(goodbye=link_pb2.Goodbye(code=code))


def run_world(seed: int, *, count: int = 60) -> World:
    """A world's whole life, checked at its end."""
    world = World(seed)
    for _ in range(count):
        world.step()
    world.heal()
    world.check()
    return world
