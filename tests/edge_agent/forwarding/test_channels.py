"""Channels: ids, announcements, series, classes by QoS, statistics."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from metaros._proto import link_pb2
from metaros.idl import Catalogue, add_schema_text, type_hash
from metaros.limits import Limits
from tests.edge_agent.parts import accept, make_outbox
from tests.support.simulation.sim_disk import SimDisk

STRING = "std_msgs/msg/String"
BATTERY = "sensor_msgs/msg/BatteryState"


def observe(channels: Channels, topic: str, name: str = STRING, *, qos: str = "", keeps_all: bool = False) -> Channel:
    channel = channels.observe(topic, name, type_hash(name), qos=qos, keeps_all=keeps_all)
    assert channel is not None
    return channel


def test_a_known_type_is_described_with_its_schema() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/sim_1")
    observe(channels, "/sim_1/chat", qos="::,7:,:,:,,")
    (announce,) = channels.announcements(0)
    (channel,) = announce.channels
    assert (channel.channel_id, channel.topic, channel.encoding) == (1, "/sim_1/chat", "cdr")
    assert (channel.schema_name, channel.schema_encoding, channel.type_hash) == (STRING, "ros2msg", type_hash(STRING))
    assert channel.schema.decode().strip() == "string data"
    assert channel.qos == "::,7:,:,:,,"
    assert getattr(channel, "class") == link_pb2.DELIVERY_CLASS_LIVE
    assert (channel.max_rate_hz, channel.forward) == (10.0, True)


def test_an_unknown_type_or_hash_is_forwarded_without_schema_and_series() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    assert channels.observe("/motor_temperature", BATTERY, "RIHS01_00", qos="", keeps_all=False) is not None
    assert channels.observe("/other", "acme_msgs/msg/Thing", "RIHS01_00", qos="", keeps_all=False) is not None
    (announce,) = channels.announcements(0)
    assert [channel.schema_encoding for channel in announce.channels] == ["", ""]
    assert not announce.series


def test_series_come_from_the_rows_fields_that_the_type_has() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/sim_1")
    observe(channels, "/sim_1/battery_state", BATTERY)
    observe(channels, "/sim_1/odom", STRING)
    (announce,) = channels.announcements(0)
    assert [(item.series_id, item.name, item.topic, item.field) for item in announce.series] == [
        (1, "battery_state.percentage", "/sim_1/battery_state", "percentage"),
        (2, "battery_state.voltage", "/sim_1/battery_state", "voltage"),
        (3, "battery_state.current", "/sim_1/battery_state", "current"),
        (4, "battery_state.temperature", "/sim_1/battery_state", "temperature"),
    ]


def test_announcements_are_cumulative() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    observe(channels, "/a")
    seen = channels.revision
    observe(channels, "/battery_state", BATTERY)
    (announce,) = channels.announcements(seen)
    assert [channel.topic for channel in announce.channels] == ["/battery_state"] * 2
    assert len(announce.series) == 4
    assert list(channels.announcements(channels.revision)) == []
    (everything,) = channels.announcements(0)
    assert len(everything.channels) == 3


def test_a_publisher_that_keeps_all_makes_bulk_without_a_limit_even_later() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    live = observe(channels, "/scan")
    live.messages = 7
    assert live.delivery == "live"
    seen = channels.revision
    channel = observe(channels, "/scan", keeps_all=True)
    assert (channel.delivery, channel.max_rate_hz, channel.schema, channel.messages) == ("bulk", 0.0, live.schema, 7)
    assert channel.channel_id != live.channel_id, "a live sample's number must not be taken for a durable one's"
    (announce,) = channels.announcements(seen)
    assert getattr(announce.channels[0], "class") == link_pb2.DELIVERY_CLASS_BULK
    assert observe(channels, "/scan").delivery == "bulk"


def test_an_explicit_class_is_not_lifted() -> None:
    channels = Channels(
        TopicTable([TopicRule(match="**", delivery="live", max_rate_hz=3)]), make_outbox().ids, namespace="/"
    )
    channel = observe(channels, "/scan", keeps_all=True)
    assert (channel.delivery, channel.max_rate_hz) == ("live", 3)


def test_limits_hold() -> None:
    channels = Channels(
        TopicTable(), make_outbox().ids, namespace="/", limits=Limits(channels_per_robot=3, series_per_robot=3)
    )
    observe(channels, "/battery_state", BATTERY)
    observe(channels, "/a")
    assert channels.observe("/b", STRING, "x", qos="", keeps_all=False) is None
    assert (len(channels), channels.refused) == (3, 1)
    (announce,) = channels.announcements(0)
    assert len(announce.series) == 3


def test_demand_reaches_the_selectors() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    a, b = observe(channels, "/a"), observe(channels, "/b")
    channels.demand({1: 4.0, 77: 1.0})
    assert (a.selector.demand_hz, b.selector.demand_hz) == (4.0, None)
    channels.demand({})
    assert a.selector.demand_hz is None


def test_many_schemas_are_split_over_frames() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    for number in range(600):
        observe(channels, f"/odom_{number}", "nav_msgs/msg/Odometry")  # no row names these
    frames = list(channels.announcements(0))
    assert sum(len(frame.channels) for frame in frames) == 600
    assert len(frames) > 1
    assert all(frame.ByteSize() < 2 << 20 for frame in frames)


def test_rates() -> None:
    channel = observe(Channels(TopicTable(), make_outbox().ids, namespace="/"), "/a")
    assert channel.rate(10.0).rate_hz == 0.0
    channel.messages, channel.size_bytes, channel.dropped = 20, 2000, 1
    rate = channel.rate(12.0)
    assert (rate.rate_hz, rate.bytes_per_s) == (pytest.approx(10.0), pytest.approx(1000.0))
    assert (rate.messages, rate.dropped) == (20, 1)


def test_numbers_mean_one_thing_for_ever() -> None:
    disk = SimDisk(random.Random(1))
    outbox = make_outbox(disk)
    channels = Channels(TopicTable(), outbox.ids, namespace="/")
    observe(channels, "/gone")
    scan, battery = observe(channels, "/scan", keeps_all=True), observe(channels, "/battery_state", BATTERY)
    assert battery.metrics is not None
    outbox.append(scan.channel_id, "bulk", 1, b"x")
    accept(outbox)
    outbox = make_outbox(disk, seed=2)
    again = Channels(TopicTable(), outbox.ids, namespace="/")
    (announce,) = again.announcements(0)
    held = [(item.channel_id, item.topic, item.schema_name, item.schema_encoding) for item in announce.channels]
    assert held == [(scan.channel_id, "/scan", STRING, "ros2msg")]
    assert [item.series_id for item in announce.series] == [1, 2, 3, 4]
    assert observe(again, "/scan", keeps_all=True).channel_id == scan.channel_id
    assert observe(again, "/new").channel_id > battery.channel_id
    metrics = observe(again, "/battery_state", BATTERY).metrics
    assert metrics is not None
    assert metrics.series_ids == battery.metrics.series_ids


def test_the_schema_of_a_type_that_was_learned_is_kept_for_what_is_held() -> None:
    disk = SimDisk(random.Random(1))
    outbox = make_outbox(disk)
    channels = Channels(TopicTable(), outbox.ids, namespace="/")
    thing = channels.observe("/thing", "acme_msgs/msg/Thing", "RIHS01_00", qos="", keeps_all=True)
    assert thing is not None
    catalogue = Catalogue()
    add_schema_text("acme_msgs/msg/Thing", "int32 a", catalogue)
    channels.learn(thing, catalogue)
    outbox.append(thing.channel_id, "bulk", 1, b"x")
    accept(outbox)
    (announce,) = Channels(TopicTable(), make_outbox(disk, seed=2).ids, namespace="/").announcements(0)
    assert announce.channels[0].schema == thing.schema != b""


def test_a_row_of_another_class_since_gives_a_topic_another_number() -> None:
    disk = SimDisk(random.Random(1))
    outbox = make_outbox(disk)
    before = observe(Channels(TopicTable(), outbox.ids, namespace="/"), "/scan", keeps_all=True)
    outbox.append(before.channel_id, "bulk", 1, b"x")
    accept(outbox)
    table = TopicTable([TopicRule(match="**", delivery="event")])
    channels = Channels(table, make_outbox(disk, seed=2).ids, namespace="/")
    now = observe(channels, "/scan")
    assert (before.delivery, now.delivery) == ("bulk", "event")
    assert now.channel_id != before.channel_id
    assert {channel.channel_id: channel.delivery for channel in channels} == {
        before.channel_id: "bulk",
        now.channel_id: "event",
    }
