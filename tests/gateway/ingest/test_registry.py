"""What is known about robots, and what waits for a lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gateway.domain.channel import Channel, Series
from gateway.domain.robot import Robot, is_robot_id
from gateway.domain.sample import Gap, Rows, Run
from gateway.errors import UnknownRobotError
from gateway.ingest.outbox import LaneOutbox
from gateway.ingest.registry import Counts, RateMeter, Registry, RobotRecord
from metaros._proto import cluster_pb2, link_pb2
from metaros.link import SampleColumns


def make_channel(number: int, topic: str) -> Channel:
    return Channel(robot="r", channel_id=number, topic=topic, schema_name="a/msg/B", type_hash="")


def make_run(channel: Channel, count: int) -> Run:
    columns = SampleColumns(
        stream_id=channel.channel_id,
        epoch=1,
        first_seq=1,
        stamps_ns=np.arange(count, dtype=np.int64),
        offsets=np.arange(count + 1, dtype=np.int64) * 2,
        payload=bytes(2 * count),
    )
    return Run(channel, columns, 9)


def test_a_new_agent_process_keeps_the_topics_counts() -> None:
    record = RobotRecord(Robot("r"), seen_ns=0)
    record.begin(Robot("r"), session_id=b"a", session_number=1)
    record.announce([make_channel(1, "/scan"), make_channel(2, "/odom")], [])
    record.count_run(make_run(make_channel(1, "/scan"), 5), 0, now_s=0.0)
    record.count_gap(1, Gap(6, 8, "outbox_full", 0, 0))
    record.begin(Robot("r"), session_id=b"b", session_number=2)
    assert record.channels == {}
    record.announce([make_channel(7, "/scan")], [])
    state = record.channels[7]
    assert (state.received, state.received_bytes, state.lost) == (5, 10, 3)
    assert record.channel_of("/scan") == state.channel
    assert record.channel_of("/odom") is None


def test_how_late_samples_come_is_a_number_that_other_gateways_can_be_reported() -> None:
    record, now_ns = RobotRecord(Robot("r"), seen_ns=0), 1_700_000_000 * 10**9
    record.announce([channel := make_channel(1, "/scan")], [])
    run = make_run(channel, 1)
    for stamp_ns, lag_ns in ((now_ns - 5, 5), (2**63 - 1, now_ns + 1 - 2**63), (-(2**63), 2**63 - 1)):
        columns = replace(run.columns, stamps_ns=np.array([stamp_ns]))
        record.count_run(replace(run, columns=columns, receive_ns=now_ns), 0, now_s=0.0)
        assert record.lag_ns == cluster_pb2.MirroredState(lag_ns=record.lag_ns).lag_ns == lag_ns


def test_the_same_process_keeps_its_channels() -> None:
    record = RobotRecord(Robot("r"), seen_ns=0)
    record.begin(Robot("r"), session_id=b"a", session_number=1)
    record.announce([make_channel(1, "/scan")], [])
    record.begin(Robot("r"), session_id=b"a", session_number=2)
    assert list(record.channels) == [1]


def test_a_topic_with_another_class_has_another_channel_and_the_newest_is_shown() -> None:
    record = RobotRecord(Robot("r"), seen_ns=0)
    record.announce([make_channel(1, "/scan"), make_channel(2, "/odom")], [])
    record.count_run(make_run(make_channel(1, "/scan"), 5), 0, now_s=0.0)
    record.announce([make_channel(3, "/scan")], [])
    record.announce([make_channel(1, "/scan")], [])
    record.count_run(make_run(make_channel(3, "/scan"), 2), 0, now_s=0.0)
    assert [(state.channel.channel_id, state.received) for state in record.topics()] == [(2, 0), (3, 7)]
    channel = record.channel_of("/scan")
    assert channel is not None
    assert channel.channel_id == 3


def test_newest_values_and_headline() -> None:
    record = RobotRecord(Robot("r"), seen_ns=0)
    series = tuple(Series(f"s{n:03}", "/t", "x") for n in range(100))
    rows = Rows(series, np.arange(100, dtype=np.uint32), np.arange(100), np.arange(100.0))
    assert record.count_rows(rows, 0, wall_ns=1, now_s=0.0)["s099"] == (99, 99.0)
    assert len(record.newest()) == 100
    assert list(record.headline())[-1] == "s063"


def test_rate_meter_forgets() -> None:
    meter = RateMeter(span_s=2.0)
    for tick in range(200):
        meter.add(100, tick / 10)
    assert meter.read(20.0) == pytest.approx(1000, rel=0.1)
    assert meter.read(60.0) < 0.001


def test_unknown_robots() -> None:
    registry = Registry()
    assert registry.find("r") is None
    with pytest.raises(UnknownRobotError):
        registry.get("r")
    first = registry.add(RobotRecord(Robot("r"), seen_ns=0))
    assert registry.add(RobotRecord(Robot("r"), seen_ns=5)) is first


@pytest.mark.parametrize("good", ["a", "sim_1", "R2.d2-x", "0" * 64])
def test_robot_ids(good: str) -> None:
    assert is_robot_id(good)


@pytest.mark.parametrize("bad", ["", "_a", "a b", "a/b", "ä", "x" * 65, "a\n"])
def test_no_robot_ids(bad: str) -> None:
    assert not is_robot_id(bad)


async def test_an_outbox_keeps_order_and_only_the_newest_teleop() -> None:
    outbox = LaneOutbox(max_bytes=100)
    beat = link_pb2.GatewayFrame(heartbeat=link_pb2.Heartbeat(sent_ns=1))
    assert outbox.put(beat)
    for seq in (1, 2):
        assert outbox.put(link_pb2.GatewayFrame(teleop=link_pb2.Teleop(seq=seq)))
    assert not outbox.put(link_pb2.GatewayFrame(goodbye=link_pb2.Goodbye(message="x" * 200)))
    outbox_frames = [await outbox.next(), await outbox.next()]
    assert outbox_frames[0] is not None
    assert outbox_frames[0].teleop.seq == 2
    assert outbox_frames[1] == beat
    outbox.put(beat)
    outbox.close()
    assert not outbox.put(beat)
    assert (await outbox.next(), await outbox.next()) == (beat, None)


def make_history(number: int, topic: str) -> Channel:
    return replace(make_channel(number, topic), delivery="bulk", history=True)


def test_a_history_channel_is_counted_and_not_listed() -> None:
    record = RobotRecord(Robot("r"), seen_ns=0)
    record.begin(Robot("r"), session_id=b"a", session_number=1)
    record.announce([make_history(9, "/scan"), make_channel(2, "/scan")], [])
    record.count_run(make_run(make_history(9, "/scan"), 5), 0, now_s=0.0)
    record.count_gap(9, Gap(6, 8, "outbox_full", 0, 0))
    (topic,) = record.topics()
    assert (topic.channel.channel_id, topic.received, topic.lost, record.listed()) == (2, 0, 3, 1)
    assert (record.counts.samples, record.channels[9].received) == (5, 5)
    assert record.channel_of("/scan") == topic.channel
    record.begin(Robot("r"), session_id=b"b", session_number=2)
    record.announce([make_channel(3, "/scan"), make_history(10, "/scan")], [])
    assert (record.channels[3].received, record.channels[10].received) == (0, 5), "each goes on with its own counts"


def test_a_robot_is_online_here_or_at_its_owner() -> None:
    record = RobotRecord(Robot("r"), seen_ns=1)
    record.set_owner("b", 7, wall_ns=5)
    assert (record.online, record.here, record.owner_gateway, record.owner_session, record.since_ns) == (
        True,
        False,
        "b",
        7,
        5,
    )
    record.owner_counts = Counts(samples=3)
    assert (record.shown_counts.samples, record.counts.samples) == (3, 0)
    record.set_online(True, wall_ns=6)  # it came here: that link is the only one
    assert (record.online, record.here, record.owner_gateway, record.owner_session) == (True, True, "", 0)
    assert record.shown_counts is record.counts
    assert record.since_ns == 5, "it was never away"
    record.set_owner("b", 8, wall_ns=7)
    record.set_online(False, wall_ns=8)
    assert (record.online, record.here, record.owner_gateway) == (True, False, "b")
    record.set_owner("", 0, wall_ns=9)
    assert (record.online, record.since_ns) == (False, 9)


def test_each_process_of_an_agent_has_another_generation_of_channels() -> None:
    record = RobotRecord(Robot("r"), seen_ns=1)
    record.begin(Robot("r"), session_id=b"a", session_number=1)
    first = record.generation
    record.begin(Robot("r"), session_id=b"a", session_number=2)
    assert record.generation == first
    record.begin(Robot("r"), session_id=b"b", session_number=3)
    assert record.generation == first + 1
