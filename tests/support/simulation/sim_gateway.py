"""The gateway's half of the simulated world: its real session and stream table before a store that cannot do half."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from edge_agent.uplink.session import LANES
from gateway.errors import FencedError, ForkedError, LinkError
from gateway.ingest.events import Arrived, Closed, GapDeclared, RowsArrived, Send, WriterKnown
from gateway.ingest.session import Session
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import Limits

__all__ = ["Gateway", "Key", "Link", "SimStore"]

Key = tuple[int, int]  # stream, epoch
RETRY_MS = 20


@dataclass
class SimStore:
    """What the gateway has for ever: rows by number, gaps, watermarks, writers; a commit is all or nothing."""

    rows: dict[Key, dict[int, int]] = field(default_factory=dict)
    gaps: dict[Key, set[int]] = field(default_factory=dict)
    marks: dict[Key, int] = field(default_factory=dict)
    writers: dict[int, str] = field(default_factory=dict)
    bases: dict[Key, int] = field(default_factory=dict)
    works: bool = True

    def copy(self) -> SimStore:
        """A backup."""
        return SimStore(
            {key: dict(rows) for key, rows in self.rows.items()},
            {key: set(gaps) for key, gaps in self.gaps.items()},
            dict(self.marks),
            dict(self.writers),
            dict(self.bases),
        )

    def commit(self, events: list[object]) -> list[tuple[int, int, int]]:
        """Store what follows its stream's watermark, and nothing else; the watermarks to acknowledge."""
        touched: dict[Key, None] = {}
        for event in events:
            if isinstance(event, WriterKnown):
                self.writers.update(event.writers)
                continue
            key, first, last, stamps = described(event)
            touched[key] = None
            mark = self.marks.get(key, self.bases.get(key, 0))
            if self.fits(first, last, mark):
                self.put(key, first, last, stamps, mark)
                self.marks[key] = last
        return [(*key, self.marks[key]) for key in touched if key in self.marks]

    def fits(self, first: int, last: int, mark: int) -> bool:
        """Not so where what was before it was refused, or where it was stored meanwhile."""
        return first <= mark + 1 and last > mark

    def put(self, key: Key, first: int, last: int, stamps: list[int] | None, mark: int) -> None:
        """The part of a write that is new."""
        if stamps is None:
            self.gaps.setdefault(key, set()).update(range(max(first, mark + 1), last + 1))
            return
        rows = self.rows.setdefault(key, {})
        rows.update((seq, stamp) for seq, stamp in enumerate(stamps, first) if seq > mark)


def described(event: object) -> tuple[Key, int, int, list[int] | None]:
    """A write's stream, its numbers, and its samples' stamps (none for a gap)."""
    if isinstance(event, GapDeclared):
        return (event.stream_id, event.epoch), event.gap.from_seq, event.gap.to_seq, None
    if isinstance(event, RowsArrived):
        stamps = event.rows.stamps.tolist()
        return (event.stream_id, event.epoch), event.seq - len(stamps) + 1, event.seq, stamps
    assert isinstance(event, Arrived)
    columns = event.run.columns
    return (columns.stream_id, event.epoch), columns.first_seq, event.seq, columns.stamps_ns.tolist()


@dataclass(eq=False)
class Link:
    """Three lanes of frames under way; `lost` once nothing arrives any more, whoever knows it."""

    up: dict[int, deque[bytes]] = field(default_factory=lambda: {lane: deque() for lane in LANES})
    down: dict[int, deque[link_pb2.GatewayFrame]] = field(default_factory=lambda: {lane: deque() for lane in LANES})
    lost: bool = False

    def say(self, lane: int, frame: link_pb2.GatewayFrame) -> None:
        """A frame of the gateway."""
        if not self.lost:
            self.down[lane].append(frame)

    def lose(self) -> None:
        """The network ends here."""
        self.lost = True
        for queue in (*self.up.values(), *self.down.values()):
            queue.clear()  # type: ignore[attr-defined]


class Gateway:
    """One robot, a queue to the store, sessions that fence one another."""

    table: type[StreamTable] = StreamTable
    session_type: type[Session] = Session

    def __init__(self, store: SimStore, clock: ManualClock, *, limits: Limits) -> None:
        self.store = store
        self.clock = clock
        self.limits = limits
        self.streams = self.table(store.marks, writers=store.writers)
        self.session: Session | None = None
        self.link: Link | None = None
        self.queue: list[object] = []
        self.live: list[int] = []
        self.not_held: list[Key] = []  # what the agent had let go before it was stored
        self.forks = 0
        self.refusals = 0  # so many of the next frames meet a RetryLater

    def hello(self, link: Link, lane: int, hello: link_pb2.Hello) -> None:
        """A lane's first frame."""
        try:
            if self.session is None or self.session.number != hello.session_number:
                self.begin(link, hello)
            assert self.session is not None
            for state in hello.streams:
                self.store.bases.setdefault((state.stream_id, state.epoch), state.base_seq)
            self.apply(self.session.open_lane(hello, now_s=self.clock.monotonic_s(), wall_ns=self.clock.wall_ns()))
        except LinkError as error:
            self.forks += isinstance(error, ForkedError)
            link.say(lane, link_pb2.GatewayFrame(goodbye=link_pb2.Goodbye(code=error.code)))

    def begin(self, link: Link, hello: link_pb2.Hello) -> None:
        """A newer session takes the older one's place."""
        if self.session is not None and hello.session_number < self.session.number:
            raise FencedError("older")
        if self.streams.forked(hello):
            raise ForkedError("a copy")
        if self.session is not None:
            self.apply(self.session.close("fenced", "newer"))
        self.session = self.session_type(hello, self.streams, gateway_id="g", store_id="s", limits=self.limits)
        self.link = link

    def receive(self, link: Link, lane: int, data: bytes) -> None:
        """Any frame."""
        frame = link_pb2.AgentFrame.FromString(data)
        if frame.WhichOneof("frame") == "hello":
            self.hello(link, lane, frame.hello)
        elif self.session is not None and self.link is link:
            if not self.store.works or self.refusals > 0:
                self.refusals -= 1
                self.apply(self.session.refuse("rate", retry_after_ms=RETRY_MS))
            now_s, wall_ns = self.clock.monotonic_s(), self.clock.wall_ns()
            self.apply(self.session.receive(lane, frame, now_s=now_s, wall_ns=wall_ns))

    def apply(self, events: list[object]) -> None:
        """What a session's call caused."""
        for event in events:
            if isinstance(event, Send):
                if self.link is not None:
                    self.link.say(event.lane, event.frame)
            elif isinstance(event, Closed):
                self.session, self.link = None, None
            elif isinstance(event, Arrived) and not event.durable:
                self.live += event.run.columns.stamps_ns.tolist()
            elif isinstance(event, Arrived | RowsArrived | GapDeclared | WriterKnown):
                self.submit(event)

    def submit(self, event: object) -> None:
        """It waits for the next commit."""
        self.queue.append(event)
        if isinstance(event, GapDeclared) and event.gap.reason == "not_held":
            self.not_held.append((event.stream_id, event.epoch))
        if not isinstance(event, WriterKnown):
            self.streams.submitted(event.epoch)  # type: ignore[attr-defined]

    def commit(self, count: int) -> None:
        """One group commit of what waits, or the store's refusal."""
        events, self.queue = self.queue[:count], self.queue[count:]
        if not self.store.works:
            self.queue = [event for event in (*events, *self.queue) if isinstance(event, WriterKnown)]
            self.streams.gave_up()
            if self.session is not None:
                self.apply(self.session.refuse("store_error", retry_after_ms=RETRY_MS))
            return
        acks = self.store.commit(events)
        for event in events:
            if isinstance(event, WriterKnown):
                for epoch, writer in event.writers.items():
                    self.streams.commit_writer(epoch, writer)
            else:
                self.streams.settled(event.epoch)  # type: ignore[attr-defined]
        for stream, epoch, seq in acks:
            self.streams.commit(stream, epoch, seq)
        if self.session is not None:
            self.apply(self.session.committed(acks))

    def tick(self) -> None:
        """Heartbeats, and the end of a session that is silent."""
        if self.session is not None:
            self.apply(self.session.tick(now_s=self.clock.monotonic_s(), wall_ns=self.clock.wall_ns()))

    def lane_ended(self, link: Link) -> None:
        """The connection is gone, as this side has learnt."""
        if self.link is link and self.session is not None:
            self.apply(self.session.lane_ended())
