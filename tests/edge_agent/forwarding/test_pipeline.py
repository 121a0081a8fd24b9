"""From arrivals to queues."""

from __future__ import annotations

import pytest

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import METRIC_STREAM, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from edge_agent.outbox import Frame, Kind
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import message_class, type_hash
from metaros.limits import Limits
from metaros.link import BACKFILL_BIT, MetricColumns, unpack_metrics
from tests.edge_agent.parts import make_outbox, taken

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
        self.outbox, self.live, self.linger = make_outbox(), LiveQueue(), Linger()
        self.outbox.online = True
        self.channels = Channels(TABLE, self.outbox.ids, namespace="/")
        self.woken: list[str] = []
        self.pipeline = Pipeline(
            self.outbox,
            self.live,
            self.linger,
            wake_writer=lambda: self.woken.append("writer"),
            wake_uplink=lambda: self.woken.append("uplink"),
            limits=limits,
        )

    def frames(self, log: str) -> list[Frame]:
        """What the outbox has to send of a log."""
        return [item.frame for item in taken(self.outbox, log)]

    def arrivals(self, topic: str, payload: bytes, count: int, spacing_s: float = 0.01) -> list[Arrival]:
        channel = self.channels.observe(topic, BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
        assert channel is not None
        return [Arrival(channel, payload, len(payload), 1000 + i, 5.0 + i * spacing_s) for i in range(count)]


def rows_of(frame: Frame) -> MetricColumns:
    """A metric frame's rows."""
    batch = link_pb2.MetricBatch.FromString(frame.body)
    batch.epoch, batch.first_seq, batch.count = 1, frame.first_seq, frame.count
    return unpack_metrics(batch)


def battery() -> bytes:
    return codec(BATTERY).encode(message_class(BATTERY)(percentage=0.5, voltage=24.0))


def test_nothing_watched_means_metrics_only() -> None:
    rig = Rig()
    arrivals = rig.arrivals("/battery_state", battery(), 200)
    rig.pipeline.take(arrivals, 7.0)
    assert (arrivals[0].channel.messages, len(rig.live), rig.woken) == (200, 0, ["writer"])
    (frame,) = rig.frames("metric")
    assert (frame.kind, frame.stream_id, frame.first_seq, frame.count) == (Kind.METRICS, METRIC_STREAM, 1, 8)
    rows = rows_of(frame)
    assert list(zip(rows.series_ids.tolist(), rows.values.tolist(), strict=True)) == [(1, 0.5), (2, 24.0)] * 4
    assert rows.stamps_ns[0] == 1000
    assert rig.linger.wait_s(7.0) is None


def test_a_viewer_gets_the_live_samples() -> None:
    rig = Rig()
    arrivals = rig.arrivals("/battery_state", battery(), 100)
    rig.channels.demand({1: 0.0})
    rig.pipeline.take(arrivals, 6.0)
    assert len(rig.live) == 10
    assert "uplink" in rig.woken
    assert rig.linger.wait_s(7.0) == 0.0
    assert rig.live.take(1 << 20)[1][0].data == battery()


def test_bulk_keeps_all() -> None:
    rig = Rig()
    rig.pipeline.take(rig.arrivals("/bulk", b"xyz", 50), 6.0)
    (frame,) = rig.frames("bulk")
    assert (frame.kind, frame.stream_id, frame.first_seq, frame.last_seq) == (Kind.SAMPLES, 1, 1, 50)


def test_what_is_too_large_is_a_gap_or_counted() -> None:
    rig = Rig(Limits(sample_bytes=10))
    (bulk,) = rig.arrivals("/bulk", bytes(11), 1)
    (live,) = rig.arrivals("/battery_state", bytes(11), 1)
    rig.channels.demand({2: 0.0})
    rig.pipeline.take([bulk, live], 6.0)
    (frame,) = rig.frames("bulk")
    assert (frame.kind, frame.gap().reason) == (Kind.GAP, "too_large")
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
    assert [frame.count for frame in rig.frames("metric")] == [1]


def test_what_stays_on_the_robot_wakes_no_uplink() -> None:
    rig = Rig()
    rig.pipeline.take(rig.arrivals("/unlisted", b"x", 5), 6.0)
    assert "uplink" not in rig.woken
    assert rig.linger.wait_s(6.0) is None


def test_while_the_link_is_down_samples_go_to_the_back_fill() -> None:
    rig = Rig()
    rig.outbox.online = False
    rig.pipeline.take(rig.arrivals("/bulk", b"xyz", 2), 6.0)
    assert rig.frames("bulk") == []
    assert [frame.stream_id for frame in rig.frames("bulk_backfill")] == [1 | BACKFILL_BIT]


def test_rows_gather_longer_while_nobody_watches() -> None:
    rig = Rig()
    now_s, watched = rig.outbox._clock.monotonic_s(), False
    rig.pipeline._watched, rig.pipeline._patience_s = lambda: watched, 0.9
    arrivals = [arrival._replace(arrived_s=now_s) for arrival in rig.arrivals("/battery_state", battery(), 1)]
    rig.pipeline.take(arrivals, now_s)
    assert rig.outbox.due_s("metric") == pytest.approx(0.9)
    watched = True
    rig.pipeline.take([arrival._replace(arrived_s=now_s + 1.0) for arrival in arrivals], now_s + 1.0)
    assert rig.outbox.due_s("metric") == pytest.approx(0.9), "the older of both"
    bulk = [arrival._replace(arrived_s=now_s) for arrival in rig.arrivals("/bulk", b"x", 1)]
    watched = False
    rig.pipeline.take(bulk, now_s)
    assert rig.outbox.due_s("bulk") == pytest.approx(0.0), "what somebody wants kept does not wait"
