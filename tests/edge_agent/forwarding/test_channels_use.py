"""Another topic table while the agent runs: rates and dead-bands at once, another class by another channel."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from dataclasses import replace

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from metaros.cdr import codec
from metaros.idl import message_class, type_hash
from metaros.limits import Limits
from tests.edge_agent.parts import accept, make_outbox, taken
from tests.support.simulation.sim_disk import SimDisk

STRING, BATTERY = "std_msgs/msg/String", "sensor_msgs/msg/BatteryState"
LIVE = TopicRule(match="/battery", delivery="live", max_rate_hz=10.0, fields=("percentage",))


class Rig:
    """Channels, an outbox and the pipeline between them."""

    def __init__(self, *rules: TopicRule, limits: Limits | None = None) -> None:
        self.outbox = make_outbox()
        self.outbox.online = True
        self.channels = Channels(TopicTable(rules), self.outbox.ids, namespace="/", limits=limits or Limits())
        self.live = LiveQueue()
        self.pipeline = Pipeline(self.outbox, self.live, Linger(), wake_writer=lambda: None, wake_uplink=lambda: None)

    def observe(self, topic: str = "/battery", name: str = BATTERY, *, keeps_all: bool = False) -> Channel:
        channel = self.channels.observe(topic, name, type_hash(name), qos="", keeps_all=keeps_all)
        assert channel is not None
        return channel

    def use(self, *rules: TopicRule) -> list[str]:
        return self.channels.use(TopicTable(rules))

    def sample(self, channel: Channel, at_s: float, percentage: float = 0.5) -> None:
        payload = codec(BATTERY).encode(message_class(BATTERY)(percentage=percentage))
        self.pipeline.take([Arrival(channel, payload, len(payload), 7, at_s)], at_s)

    def announced(self, after: int) -> list[int]:
        return [channel.channel_id for frame in self.channels.announcements(after) for channel in frame.channels]


def test_a_rate_changes_at_once_and_viewers_keep_what_they_asked_for() -> None:
    rig = Rig(LIVE)
    channel = rig.observe()
    rig.channels.demand({channel.channel_id: 0.0})
    before = rig.channels.revision
    assert rig.use(replace(LIVE, max_rate_hz=2.0)) == []
    assert (channel.max_rate_hz, channel.selector.demand_hz) == (2.0, 2.0)
    assert rig.announced(before) == [channel.channel_id]
    rig.use(replace(LIVE, max_rate_hz=50.0))
    assert channel.selector.demand_hz == 50.0
    assert rig.observe() is channel


def test_what_does_not_change_is_not_announced_again() -> None:
    rig = Rig(LIVE)
    rig.observe()
    before = rig.channels.revision
    rig.use(LIVE, TopicRule(match="/other"))
    assert rig.channels.revision == before


def test_a_topic_is_kept_on_the_robot_and_let_out_again() -> None:
    rig = Rig(replace(LIVE, delivery="bulk"))
    channel = rig.observe()
    rig.use(replace(LIVE, delivery="bulk", forward=False))
    rig.sample(channel, 1.0)
    assert not taken(rig.outbox, "bulk")
    rig.use(replace(LIVE, delivery="bulk"))
    rig.sample(channel, 2.0)
    assert len(taken(rig.outbox, "bulk")) == 1


def test_another_class_is_another_channel_and_nothing_accepted_is_lost() -> None:
    rig = Rig(replace(LIVE, delivery="bulk"))
    bulk = rig.observe()
    rig.sample(bulk, 1.0)
    before = rig.channels.revision
    rig.use(replace(LIVE, delivery="event"))
    event = rig.observe()
    assert (event.delivery, event.channel_id > bulk.channel_id) == ("event", True)
    assert rig.announced(before) == [event.channel_id]
    rig.sample(bulk, 2.0)  # it was on its way
    rig.sample(event, 3.0)
    accept(rig.outbox)
    assert sum(each.frame.count for each in taken(rig.outbox, "bulk")) == 2
    (sent,) = taken(rig.outbox, "event")
    assert sent.frame.stream_id == event.channel_id
    assert event.messages == 2  # with what the topic had before: one count a topic
    known = {each.channel: each.delivery for each in rig.outbox.ids.channels.values()}
    assert known == {bulk.channel_id: "bulk", event.channel_id: "event"}


def test_back_and_forth_never_gives_a_number_twice() -> None:
    rig = Rig(LIVE)
    numbers = [rig.observe().channel_id]
    for delivery in ("bulk", "live", "bulk", "event", "live"):
        rig.use(replace(LIVE, delivery=delivery))
        numbers.append(rig.observe().channel_id)
    assert len(set(numbers)) == len(numbers) == 6
    assert numbers == sorted(numbers)


def test_the_numbers_of_a_changed_table_are_kept_over_a_restart() -> None:
    disk = SimDisk(random.Random(1))
    outbox = make_outbox(disk)
    channels = Channels(TopicTable([replace(LIVE, delivery="bulk")]), outbox.ids, namespace="/")
    first = channels.observe("/battery", BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
    assert first is not None
    outbox.append(first.channel_id, "bulk", 7, b"one")
    channels.use(TopicTable([replace(LIVE, delivery="event")]))
    second = channels.observe("/battery", BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
    assert second is not None
    outbox.append(second.channel_id, "event", 7, b"two")
    accept(outbox)
    again = make_outbox(disk, seed=2)
    channels = Channels(TopicTable([replace(LIVE, delivery="event")]), again.ids, namespace="/")
    found = channels.observe("/battery", BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
    assert found is not None
    assert found.channel_id == second.channel_id
    old = channels.by_id(first.channel_id)
    assert old is not None
    assert old.delivery == "bulk"


def test_fields_and_dead_bands_change_at_once() -> None:
    rig = Rig(replace(LIVE, delivery="bulk", max_rate_hz=0.0))
    channel = rig.observe()
    rig.use(replace(LIVE, delivery="bulk", max_rate_hz=0.0, deadband=0.1, fields=("percentage", "voltage")))
    for step in range(5):
        rig.sample(channel, 1.0 + step)
    assert sum(each.frame.count for each in taken(rig.outbox, "bulk")) == 1
    assert channel.thinned == 4
    assert set(rig.outbox.ids.series) == {"battery.percentage", "battery.voltage"}
    rig.use(replace(LIVE, delivery="bulk", max_rate_hz=0.0))
    rig.sample(channel, 10.0)
    rig.sample(channel, 11.0)
    assert sum(each.frame.count for each in taken(rig.outbox, "bulk")) == 2


def test_the_history_copy_comes_and_goes_and_comes_under_its_number() -> None:
    rig = Rig(LIVE)
    channel = rig.observe()
    rig.use(replace(LIVE, history_hz=1.0))
    copy = channel.copy
    assert copy is not None
    assert (copy.history, copy.delivery, copy.max_rate_hz) == (True, "bulk", 1.0)
    rig.use(LIVE)
    assert rig.observe().copy is None
    rig.use(replace(LIVE, history_hz=4.0))
    assert rig.observe().copy is copy
    assert copy.max_rate_hz == 4.0
    (described,) = [each for frame in rig.channels.announcements(0) for each in frame.channels if each.history]
    assert described.max_rate_hz == 4.0


def test_a_publisher_that_keeps_all_lifts_a_topic_that_becomes_auto() -> None:
    rig = Rig(LIVE)
    rig.observe(keeps_all=True)
    rig.use(replace(LIVE, delivery="auto"))
    assert rig.observe(keeps_all=True).delivery == "bulk"


def test_in_a_full_table_a_topic_keeps_its_class() -> None:
    rig = Rig(LIVE, limits=Limits(channels_per_robot=1))
    channel = rig.observe()
    assert rig.use(replace(LIVE, delivery="bulk")) == ["/battery"]
    assert rig.observe() is channel
    assert channel.delivery == "live"
