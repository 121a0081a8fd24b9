"""History channels: what a live topic leaves behind when nobody watches."""

from __future__ import annotations

import itertools
import random  # noqa: TID251 - seeded

from edge_agent.config.topic_table import DEFAULT_TOPICS, TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.host_metrics import topic_rates
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from edge_agent.outbox import Kind
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import Catalogue, add_schema_text, message_class, type_hash
from metaros.limits import LIMITS, Limits
from metaros.link import unpack_batch
from tests.edge_agent.parts import accept, make_outbox, taken
from tests.support.simulation.sim_disk import SimDisk

KIND = "sensor_msgs/msg/Temperature"
TABLE = TopicTable(
    [
        TopicRule(match="/kept", max_rate_hz=20, history_hz=2, fields=("temperature",)),
        TopicRule(
            match="/band", history_hz=10, fields=("temperature",), deadband=0.5, deadband_max_s=0, latest_only=True
        ),
        TopicRule(match="**"),
    ]
)


class Rig:
    """An agent from arrivals to its queues."""

    def __init__(self, disk: SimDisk | None = None, *, table: TopicTable = TABLE, seed: int = 1) -> None:
        self.disk = disk or SimDisk(random.Random(1))
        self.outbox, self.live = make_outbox(self.disk, seed=seed), LiveQueue()
        self.outbox.online = True
        self.now_s = 100.0
        self.channels = Channels(table, self.outbox.ids, namespace="/")
        self.pipeline = Pipeline(self.outbox, self.live, Linger(), wake_writer=lambda: None, wake_uplink=lambda: None)

    def channel(self, topic: str = "/kept", *, keeps_all: bool = False) -> Channel:
        """As the tap sees it."""
        channel = self.channels.observe(topic, KIND, type_hash(KIND), qos="", keeps_all=keeps_all)
        assert channel is not None
        return channel

    def copy(self, topic: str = "/kept") -> Channel:
        """Its history channel."""
        copy = self.channel(topic).copy
        assert copy is not None
        return copy

    def feed(self, channel: Channel, seconds: float, rate_hz: int, *, value: float = 0.0) -> None:
        """Samples whose stamps are milliseconds."""
        payload = temperature(value)
        for step in range(round(seconds * rate_hz)):
            at_s = self.now_s + step / rate_hz
            self.pipeline.take([Arrival(channel, payload, len(payload), round(at_s * 1000), at_s)], at_s)
        self.now_s += seconds

    def held(self) -> dict[int, list[int]]:
        """Stamps of bulk in the outbox, by channel."""
        held: dict[int, list[int]] = {}
        for item in taken(self.outbox, "bulk"):
            if item.frame.kind is Kind.SAMPLES:
                batch = link_pb2.Batch.FromString(item.frame.body)
                batch.stream_id, batch.first_seq, batch.count = (
                    item.frame.stream_id,
                    item.frame.first_seq,
                    item.frame.count,
                )
                held.setdefault(item.frame.stream_id, []).extend(unpack_batch(batch).stamps_ns.tolist())
        return held

    def announced(self) -> dict[int, link_pb2.Channel]:
        """What the gateway is told."""
        return {item.channel_id: item for announce in self.channels.announcements(0) for item in announce.channels}


def temperature(value: float) -> bytes:
    """A sample."""
    return bytes(codec(KIND).encode(message_class(KIND)(temperature=value)))


def test_what_is_held_at_a_restart_goes_on_under_its_number_as_history() -> None:
    rig = Rig()
    copy = rig.copy()
    rig.feed(rig.channel(), 3, 20)
    accept(rig.outbox)

    again = Rig(rig.disk, seed=2)
    reported = again.announced()[copy.channel_id]
    assert (reported.history, reported.topic, getattr(reported, "class")) == (
        True,
        "/kept",
        link_pb2.DELIVERY_CLASS_BULK,
    )
    assert reported.schema
    live = again.channel()
    assert live.copy is not None
    assert live.copy.channel_id == copy.channel_id
    again.feed(live, 4, 20)
    assert len(again.held()[copy.channel_id]) == 6 + 8, "of both lives"

    without = Rig(rig.disk, table=TopicTable([TopicRule(match="**")]), seed=3)
    live = without.channel()
    without.feed(live, 3, 20)
    assert live.copy is None
    assert without.announced()[copy.channel_id].history, "what is held is history, whatever the table says now"
    assert without.announced()[live.channel_id].history_rate_hz == 0
    assert {number: len(stamps) for number, stamps in without.held().items()} == {copy.channel_id: 14}


def test_it_takes_its_rate_whether_anybody_watches_or_not() -> None:
    rig = Rig()
    live, copy = rig.channel(), rig.copy()
    rig.feed(live, 5, 100)
    assert len(rig.live) == 0
    unwatched = rig.held()[copy.channel_id]
    assert len(unwatched) in (10, 11)
    assert {later - sooner for sooner, later in itertools.pairwise(unwatched[1:])} == {500}

    watched = Rig()
    watched.channels.demand({watched.channel().channel_id: 20.0})
    watched.feed(watched.channel(), 5, 100)
    assert len(watched.live) in (100, 101)
    assert watched.held() == {copy.channel_id: unwatched}


def test_people_see_one_topic() -> None:
    rig = Rig()
    live, copy, plain = rig.channel(), rig.copy(), rig.channel("/plain")
    assert list(rig.channels) == [live, plain]
    assert len(rig.channels) == 3
    assert [row.topic for row in topic_rates(rig.channels, {})] == ["/kept", "/plain"]
    reported = rig.announced()
    assert [(reported[number].history, reported[number].history_rate_hz) for number in (1, 2, 3)] == [
        (False, 2.0),
        (True, 0.0),
        (False, 0.0),
    ]
    assert (copy.channel_id, reported[2].max_rate_hz, copy.metrics) == (2, 2.0, None)
    assert live.metrics is not None


def test_a_topic_that_becomes_bulk_needs_no_copy_any_more() -> None:
    rig = Rig()
    copy = rig.copy()
    bulk = rig.channel(keeps_all=True)
    rig.feed(bulk, 2, 20)
    assert (bulk.delivery, bulk.copy) == ("bulk", None)
    assert {number: len(stamps) for number, stamps in rig.held().items()} == {bulk.channel_id: 40}
    assert copy.channel_id != bulk.channel_id


def test_what_becomes_known_of_the_topic_is_reported_of_its_copy() -> None:
    outbox = make_outbox()
    channels = Channels(TopicTable([TopicRule(match="**", history_hz=1)]), outbox.ids, namespace="/")
    live = channels.observe("/thing", "acme_msgs/msg/Thing", "RIHS01_00", qos="", keeps_all=False)
    assert live is not None
    before = channels.revision
    catalogue = Catalogue()
    add_schema_text("acme_msgs/msg/Thing", "int32 a", catalogue)
    channels.learn(live, catalogue)
    channels.observe("/thing", "acme_msgs/msg/Thing", "RIHS01_00", qos="::,7:,:,:,,", keeps_all=False)
    (announce,) = channels.announcements(before)
    assert [(reported.history, reported.qos, bool(reported.schema)) for reported in announce.channels] == [
        (False, "::,7:,:,:,,", True),
        (True, "::,7:,:,:,,", True),
    ]
    assert outbox.ids.channels[2].schema


def test_a_full_table_of_channels_leaves_the_topic_live() -> None:
    channels = Channels(TABLE, make_outbox().ids, namespace="/", limits=Limits(channels_per_robot=1))
    live = channels.observe("/kept", KIND, type_hash(KIND), qos="", keeps_all=False)
    assert live is not None
    assert (live.copy, channels.refused, live.describe().history_rate_hz) == (None, 1, 0.0)


def test_a_band_holds_for_the_copy_by_itself_and_every_one_of_its_samples_is_kept() -> None:
    rig = Rig()
    live, copy = rig.channel("/band"), rig.copy("/band")
    for value in (0.0, 0.1, 2.0):
        rig.feed(live, 1, 10, value=value)
    assert len(rig.held()[copy.channel_id]) == 2
    rig.outbox.online = False  # latest_only would hold all but one back now
    for value in (4.0, 6.0, 8.0):
        rig.feed(live, 1, 10, value=value)
    accept(rig.outbox)
    assert rig.outbox.depth("bulk").samples == 5


def test_a_sample_too_large_is_declared_where_it_would_have_been_kept() -> None:
    rig = Rig()
    live, copy = rig.channel(), rig.copy()
    rig.pipeline.take([Arrival(live, b"", LIMITS.sample_bytes + 1, 1, 100.0)], 100.0)
    accept(rig.outbox)
    (item,) = taken(rig.outbox, "bulk")
    assert (item.frame.kind, item.frame.stream_id, item.frame.gap().reason) == (Kind.GAP, copy.channel_id, "too_large")


def test_the_default_table_keeps_what_the_dashboard_draws() -> None:
    kept = {rule.match: rule.history_hz for rule in DEFAULT_TOPICS if rule.history_hz}
    assert kept == {
        "**/odom": 2.0,
        "**/scan": 1.0,
        "**/battery_state": 1.0,
        "**/imu": 1.0,
        "**/compressed": 0.2,
        "**/diagnostics": 20.0,
    }
