"""A full table of series has place again after a restart, and no row that is held loses its name."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import METRIC_STREAM, Channels
from edge_agent.outbox import Kind, Outbox, forget_series
from metaros._proto import link_pb2
from metaros.idl import type_hash
from metaros.limits import Limits
from tests.edge_agent.parts import accept, make_outbox, taken
from tests.support.simulation.sim_disk import SimDisk

KIND = "sensor_msgs/msg/Temperature"
LIMITS = Limits(series_per_robot=8)
TABLE = TopicTable([TopicRule(match="**", fields=("temperature",))])


class Robot:
    """One life of an agent on a disk."""

    def __init__(self, disk: SimDisk, *, seed: int) -> None:
        self.disk = disk
        self.outbox: Outbox = make_outbox(disk, seed=seed)
        self.forgotten = forget_series(self.outbox, disk, limits=LIMITS)
        self.channels = Channels(TABLE, self.outbox.ids, namespace="/", limits=LIMITS)

    def series(self, topic: str) -> int | None:
        """The number of a topic's series; None when it got none."""
        channel = self.channels.observe(topic, KIND, type_hash(KIND), qos="", keeps_all=False)
        assert channel is not None
        return channel.metrics.series_ids[0] if channel.metrics is not None else None

    def row(self, number: int | None, *, online: bool = True) -> None:
        """A row is accepted."""
        assert number is not None
        self.outbox.online = online
        self.outbox.append(METRIC_STREAM, "metric", 1, (number, 0.5))
        accept(self.outbox)

    def held(self) -> set[int]:
        """The series of the rows that go out in a new session."""
        self.outbox.resume({})
        frames = [item.frame for log in ("metric", "metric_backfill") for item in taken(self.outbox, log)]
        batches = [link_pb2.MetricBatch.FromString(frame.body) for frame in frames if frame.kind is Kind.METRICS]
        return {
            int.from_bytes(b.series_ids[at : at + 4], "little")
            for b in batches
            for at in range(0, len(b.series_ids), 4)
        }

    def announced(self) -> dict[int, str]:
        """What the gateway is told."""
        return {item.series_id: item.name for announce in self.channels.announcements(0) for item in announce.series}


def full_table() -> Robot:
    """A robot with all of its series, of two of which rows are held."""
    robot = Robot(SimDisk(random.Random(1)), seed=1)
    numbers = [robot.series(f"/old_{index}") for index in range(9)]
    assert numbers[8] is None, "the table is full"
    robot.row(numbers[2])
    robot.row(numbers[5], online=False)
    return robot


def test_a_restart_gives_topics_series_again() -> None:
    before = full_table()
    again = Robot(before.disk, seed=2)
    assert again.forgotten == 6
    numbers = [again.series(f"/new_{index}") for index in range(7)]
    assert numbers == [9, 10, 11, 12, 13, 14, None], "no number is given twice"
    assert again.series("/old_2") == 3
    assert again.held() <= again.announced().keys()
    assert again.held() == {3, 6}
    third = Robot(before.disk, seed=3)
    assert third.outbox.ids.series["old_2.temperature"].series == 3


def test_a_full_table_gives_a_topic_the_series_that_it_had() -> None:
    before = full_table()
    channels = Channels(TABLE, make_outbox(before.disk, seed=2).ids, namespace="/", limits=LIMITS)
    channel = channels.observe("/old_7", KIND, type_hash(KIND), qos="", keeps_all=False)
    assert channel is not None
    assert channel.metrics is not None
    assert channel.metrics.series_ids == (8,)


def test_what_is_forgotten_stays_forgotten_though_the_disk_refuses_to_say_so() -> None:
    before = full_table()
    outbox = make_outbox(before.disk, seed=2)
    before.disk.fail_in = 0
    assert forget_series(outbox, before.disk, limits=LIMITS) == 6
    assert {series.series for series in outbox.ids.series.values()} == {3, 6}
    assert outbox.ids.series_number(name="x", topic="/x", field="x") == 9


def test_with_half_of_the_table_free_nothing_is_forgotten() -> None:
    robot = Robot(SimDisk(random.Random(1)), seed=1)
    for index in range(4):
        robot.series(f"/old_{index}")
    robot.row(1)
    again = Robot(robot.disk, seed=2)
    assert (again.forgotten, len(again.outbox.ids.series)) == (0, 4)


def test_nothing_is_forgotten_where_rows_cannot_be_read() -> None:
    before = full_table()
    name = next(name for name in before.disk.names("metric"))
    content = bytearray(before.disk.files[name])
    content[-1] ^= 1
    before.disk.files[name] = bytes(content)
    outbox = make_outbox(before.disk, seed=2)
    for segment in outbox.logs["metric"].segments:
        segment.end = len(content)  # as if more had come behind the damage
    assert forget_series(outbox, before.disk, limits=LIMITS) == 0
    assert len(outbox.ids.series) == 8
