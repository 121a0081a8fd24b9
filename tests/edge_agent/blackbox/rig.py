"""A black box on a small disk, with topics and their publishers, and readers of what it made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.reader import make_reader

from edge_agent.blackbox.box import RingSnapshot
from edge_agent.blackbox.publisher import RecordedPublisher
from edge_agent.blackbox.ring import Ring
from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.pipeline import Arrival
from metaros.clock import ManualClock, SystemClock
from metaros.idl import type_hash
from metaros.record.ledger import Publisher
from metaros.wire import Durability, QoSProfile
from tests.edge_agent.parts import make_outbox

__all__ = ["SECOND", "STRING", "RingRig", "arrival", "channel_of", "read_clip"]

STRING = "std_msgs/msg/String"
SECOND = 1_000_000_000
TIB = 1 << 40
LATCHED = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=1).encode()


def channel_of(topic: str, *, type_name: str = STRING, latched: bool = False, hash_text: str = "") -> Channel:
    """A tapped topic."""
    channel = Channels(TopicTable(), make_outbox().ids, namespace="/").observe(
        topic,
        type_name,
        hash_text or type_hash(type_name),
        qos=LATCHED if latched else QoSProfile().encode(),
        keeps_all=False,
    )
    assert channel is not None
    return channel


def text(data: str) -> bytes:
    """A std_msgs/String in CDR."""
    body = data.encode() + b"\0"
    return b"\0\1\0\0" + len(body).to_bytes(4, "little") + body


def arrival(channel: Channel, sequence: int, payload: bytes, *, stamp_ns: int = 0, gid: bytes = bytes(16)) -> Arrival:
    """A sample as the tap hands it over."""
    return Arrival(channel, payload, len(payload), stamp_ns, SystemClock().monotonic_s(), gid, sequence)


def read_clip(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    """Topic, sequence, log time, publish time and payload of each message, by PyPI's reader."""
    with path.open("rb") as file:
        return [
            (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
            for _schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]


@dataclass
class RingRig:
    """A ring, its clock, and publishers by topic; `free_bytes` is what the disk says."""

    folder: Path
    window_s: float = 300.0
    limit_bytes: int = 64 << 20
    free_bytes: int = TIB
    clock: ManualClock = field(default_factory=ManualClock)
    open_file: Callable[[Path], BinaryIO] = lambda path: path.open("xb", buffering=0)
    sources: dict[str, RecordedPublisher] = field(default_factory=dict)
    sequences: dict[str, int] = field(default_factory=dict)
    written: list[tuple[str, int, int, int, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.ring = self.open()

    def open(self) -> Ring:
        """Another process begins on the same folder."""
        self.ring = Ring(
            self.folder,
            self.clock,
            window_s=self.window_s,
            limit_bytes=self.limit_bytes,
            free=lambda: (self.free_bytes, TIB),
            open_file=self.open_file,
        )
        return self.ring

    def source(self, topic: str, **more: Any) -> RecordedPublisher:
        """The publisher of a topic."""
        if topic not in self.sources:
            gid = (len(self.sources) + 1).to_bytes(16, "big")
            self.sources[topic] = RecordedPublisher(channel_of(topic, **more), Publisher(topic, STRING, gid))
        return self.sources[topic]

    def put(self, topic: str, payload: bytes, **more: Any) -> None:
        """Publish one sample now."""
        source = self.source(topic, **more)
        self.sequences[topic] = sequence = self.sequences.get(topic, 0) + 1
        now_ns = self.clock.wall_ns()
        self.ring.write(source, sequence, now_ns, now_ns - 1000, payload)
        self.written.append((topic, sequence, now_ns, now_ns - 1000, payload))

    def run(self, seconds: int, *, size_bytes: int = 100, topic: str = "/odom", **more: Any) -> None:
        """Ten different samples a second."""
        for _ in range(seconds):
            for _ in range(10):
                number = self.sequences.get(topic, 0)
                self.put(topic, number.to_bytes(8, "little") * (size_bytes // 8), **more)
                self.clock.advance(0.1)
            self.ring.tick()

    def held(self) -> RingSnapshot:
        """Everything, as a reader gets it."""
        publishers = {(s.publisher.topic, s.publisher.gid): s.publisher for s in self.sources.values()}
        return RingSnapshot(self.ring.hold(), self.ring.latched_path, publishers)

    def files(self) -> Iterator[Path]:
        """The ring's files, oldest first."""
        return iter(sorted(self.folder.glob("[0-9]*.mcap")))
