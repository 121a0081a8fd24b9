"""One channel of a robot: a topic of one type in one class, what of it goes on, and its counters."""

from __future__ import annotations

from dataclasses import dataclass, field

from edge_agent.config.topic_table import Delivery, TopicRule
from edge_agent.forwarding.filters import MetricExtractor, SampleDeadband, Selector
from edge_agent.forwarding.video_queue import VideoQueue
from edge_agent.forwarding.video_selector import VideoSelector
from metaros._proto import link_pb2
from metaros.idl import Catalogue
from metaros.link.video_frames import VIDEO_TYPES
from metaros.seal.envelope import SEALED_CDR

__all__ = ["CLASS_NUMBERS", "Channel"]

CLASS_NUMBERS: dict[Delivery, link_pb2.DeliveryClass] = {
    "event": link_pb2.DELIVERY_CLASS_EVENT,
    "bulk": link_pb2.DELIVERY_CLASS_BULK,
    "live": link_pb2.DELIVERY_CLASS_LIVE,
}


@dataclass(slots=True, kw_only=True)
class Channel:
    """A topic of one type: its description, the decision what goes on, and its counters."""

    channel_id: int
    topic: str
    type_name: str
    type_hash: str
    rule: TopicRule
    delivery: Delivery
    max_rate_hz: float
    metrics: MetricExtractor | None
    schema: bytes
    qos: str = ""
    revision: int = 0
    messages: int = 0
    size_bytes: int = 0
    dropped: int = 0
    thinned: int = 0  # by the dead-band, or as latest_only has it
    deadband: SampleDeadband | None = None
    publishers: int = 0
    subscribers: int = 0
    live_seq: int = 0
    history: bool = False  # it is itself the copy of another
    sealed: bool = False
    copy: Channel | None = None
    keeps_all: bool = False  # a publisher is reliable and keeps all
    catalogue: Catalogue | None = None  # what reads its type's fields; None: unknown
    selector: Selector = field(init=False)
    video: VideoQueue | None = field(init=False, default=None)  # of a video topic: what waits of it
    _last: tuple[int, int, int] = field(default=(0, 0, 0))  # monotonic ns, messages, bytes at the last statistics

    def __post_init__(self) -> None:
        if self.type_name in VIDEO_TYPES:
            self.video = VideoQueue()
        self.use(self.rule, self.max_rate_hz)

    def use(self, rule: TopicRule, max_rate_hz: float) -> None:
        """Another row of the topic table from now on."""
        self.rule, self.max_rate_hz = rule, max_rate_hz
        if self.video is None:
            self.selector = Selector(rule, self.delivery, max_rate_hz=max_rate_hz)
        else:
            self.selector = VideoSelector(self.type_name, self.video, rule, self.delivery, max_rate_hz=max_rate_hz)

    @property
    def encoding(self) -> str:
        """What its payloads are, as MCAP and the gateway call it."""
        return SEALED_CDR if self.sealed else "cdr"

    def describe(self) -> link_pb2.Channel:
        """The Channel of an Announce."""
        return link_pb2.Channel(
            channel_id=self.channel_id,
            topic=self.topic,
            encoding=self.encoding,
            schema_name=self.type_name,
            schema_encoding="ros2msg" if self.schema else "",
            schema=self.schema,
            type_hash=self.type_hash,
            qos=self.qos,
            **{"class": CLASS_NUMBERS[self.delivery]},
            max_rate_hz=self.max_rate_hz,
            forward=self.rule.forward,
            history=self.history,
            history_rate_hz=self.copy.max_rate_hz if self.copy is not None else 0.0,
        )

    def rate(self, now_s: float) -> link_pb2.TopicRate:
        """What it did since the last call, and its totals."""
        now_ns = round(now_s * 1e9)
        then_ns, messages, size_bytes = self._last
        span_s = max((now_ns - then_ns) / 1e9, 1e-9)
        self._last = (now_ns, self.messages, self.size_bytes)
        return link_pb2.TopicRate(
            channel_id=self.channel_id,
            rate_hz=(self.messages - messages) / span_s if then_ns else 0.0,
            bytes_per_s=(self.size_bytes - size_bytes) / span_s if then_ns else 0.0,
            messages=self.messages,
            dropped=self.dropped,
            thinned=self.thinned,
            publishers=self.publishers,
            subscribers=self.subscribers,
        )
