"""From arrivals to queues."""

from __future__ import annotations

from edge_agent.batch import Linger
from edge_agent.channels import METRIC_STREAM, Channels
from edge_agent.live import LiveQueue
from edge_agent.outbox import Gap, Outbox
from edge_agent.pipeline import Arrival, Pipeline
from edge_agent.topics import TopicRule, TopicTable
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.idl import message_class, type_hash
from metaros.limits import Limits

BATTERY = "sensor_msgs/msg/BatteryState"
TABLE = TopicTable(
    [
        TopicRule(match="/battery_state", max_rate_hz=10, fields=("percentage", "voltage")),
        TopicRule(match="/bulk", delivery="bulk"),
        TopicRule(match="/local", forward=False, fields=("voltage",)),
    ]
)


class Rig:
    def __init__(self, limits: Limits = Limits()) -> None:  # noqa: B008 - frozen
        self.channels = Channels(TABLE, namespace="/")
        self.outbox, self.live, self.linger = Outbox(ManualClock(), 1), LiveQueue(), Linger()
        self.wakes = 0
        self.pipeline = Pipeline(self.outbox, self.live, self.linger, wake=self.wake, limits=limits)

    def wake(self) -> None:
        self.wakes += 1

    def arrivals(self, topic: str, payload: bytes, count: int, spacing_s: float = 0.01) -> list[Arrival]:
        channel = self.channels.observe(topic, BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
        assert channel is not None
        return [Arrival(channel, payload, len(payload), 1000 + i, 5.0 + i * spacing_s) for i in range(count)]


def battery() -> bytes:
    return codec(BATTERY).encode(message_class(BATTERY)(percentage=0.5, voltage=24.0))


def test_nothing_watched_means_metrics_only() -> None:
    rig = Rig()
    arrivals = rig.arrivals("/battery_state", battery(), 200)
    rig.pipeline.take(arrivals, 7.0)
    assert (arrivals[0].channel.messages, len(rig.live), rig.wakes) == (200, 0, 1)
    rows = rig.outbox.take(METRIC_STREAM, max_bytes=1 << 20, max_samples=1000)
    assert isinstance(rows, list)
    assert [row.data for row in rows] == [(1, 0.5), (2, 24.0)] * 5
    assert rows[0].stamp_ns == 1000
    assert rig.linger.wait_s(7.0) is not None


def test_a_viewer_gets_the_live_samples() -> None:
    rig = Rig()
    arrivals = rig.arrivals("/battery_state", battery(), 100)
    rig.channels.demand({1: 0.0})
    rig.pipeline.take(arrivals, 6.0)
    assert len(rig.live) == 11
    assert rig.live.take(1 << 20)[1][0].data == battery()


def test_bulk_keeps_all() -> None:
    rig = Rig()
    rig.pipeline.take(rig.arrivals("/bulk", b"xyz", 50), 6.0)
    run = rig.outbox.take(1, max_bytes=1 << 20, max_samples=1000)
    assert isinstance(run, list)
    assert [sample.seq for sample in run] == list(range(1, 51))


def test_what_is_too_large_is_a_gap_or_counted() -> None:
    rig = Rig(Limits(sample_bytes=10))
    (bulk,) = rig.arrivals("/bulk", bytes(11), 1)
    (live,) = rig.arrivals("/battery_state", bytes(11), 1)
    rig.channels.demand({2: 0.0})
    rig.pipeline.take([bulk, live], 6.0)
    gap = rig.outbox.take(1, max_bytes=10, max_samples=10)
    assert isinstance(gap, Gap)
    assert gap.reason == "too_large"
    assert (bulk.channel.dropped, live.channel.dropped, len(rig.live)) == (1, 1, 0)


def test_malformed_cdr_is_counted_and_still_forwarded_as_it_is() -> None:
    rig = Rig()
    arrivals = rig.arrivals("/battery_state", b"\x00\x01\x00\x00garbage", 1)
    rig.channels.demand({1: 0.0})
    rig.pipeline.take(arrivals, 6.0)
    assert rig.pipeline.malformed == 1
    assert len(rig.live) == 1


def test_local_topics_may_still_have_series() -> None:
    rig = Rig()
    rig.pipeline.take(rig.arrivals("/local", battery(), 1), 6.0)
    assert rig.outbox.sample_count == 1


def test_nothing_queued_wakes_nobody() -> None:
    rig = Rig()
    rig.pipeline.take(rig.arrivals("/unlisted", b"x", 5), 6.0)
    assert rig.wakes == 0
    assert rig.linger.wait_s(6.0) is None
