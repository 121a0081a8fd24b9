"""Dead-band and latest_only from the table to the outbox: what is left out is counted, and has no number."""

from __future__ import annotations

from collections.abc import Iterable

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from metaros.cdr import codec
from metaros.idl import message_class, type_hash
from metaros.link import BACKFILL_BIT
from tests.edge_agent.parts import make_outbox, taken
from tests.support.waiting import wait_until_async

KIND = "sensor_msgs/msg/Temperature"
BAND = {"fields": ("temperature",), "metrics_rate_hz": 0.0, "deadband": 0.5, "deadband_max_s": 10.0}
TABLE = TopicTable(
    [
        TopicRule(match="/bulk", delivery="bulk", **BAND),  # type: ignore[arg-type]
        TopicRule(match="/live", delivery="live", **BAND),  # type: ignore[arg-type]
        TopicRule(match="/latest", delivery="bulk", latest_only=True),
    ]
)


class Rig:
    def __init__(self) -> None:
        self.outbox, self.live = make_outbox(), LiveQueue()
        self.outbox.online = True
        self.channels = Channels(TABLE, self.outbox.ids, namespace="/")
        self.pipeline = Pipeline(self.outbox, self.live, Linger(), wake_writer=lambda: None, wake_uplink=lambda: None)

    def channel(self, topic: str) -> Channel:
        channel = self.channels.observe(topic, KIND, type_hash(KIND), qos="", keeps_all=False)
        assert channel is not None
        return channel

    def feed(self, topic: str, steps: Iterable[tuple[float, float]]) -> None:
        """Take (time, temperature) in."""
        channel = self.channel(topic)
        for now_s, value in steps:
            payload = codec(KIND).encode(message_class(KIND)(temperature=value))
            self.pipeline.take([Arrival(channel, payload, len(payload), round(now_s * 1e9), now_s)], now_s)

    def counts(self, log: str) -> dict[int, int]:
        """Samples that a log has to send, by stream."""
        found: dict[int, int] = {}
        for item in taken(self.outbox, log):
            found[item.frame.stream_id] = found.get(item.frame.stream_id, 0) + item.frame.count
        return found


def test_what_does_not_move_stays_on_the_robot() -> None:
    rig = Rig()
    rig.feed("/bulk", [(0.0, 20.0), (1.0, 20.4), (2.0, 20.6), (3.0, 20.2), (12.5, 20.2)])
    channel = rig.channel("/bulk")
    assert rig.counts("bulk") == {channel.channel_id: 3}
    assert (channel.thinned, channel.dropped, channel.rate(20.0).thinned) == (2, 0, 2)
    assert rig.counts("metric") == {0: 3}, "its series has the same dead-band"


def test_who_begins_to_watch_sees_where_things_stand() -> None:
    rig = Rig()
    channel = rig.channel("/live")
    rig.channels.demand({channel.channel_id: 0.0})
    rig.feed("/live", [(0.0, 20.0), (0.1, 20.0)])
    assert (len(rig.live), channel.thinned) == (1, 1)
    rig.channels.demand({channel.channel_id: 0.0})
    rig.feed("/live", [(0.2, 20.0)])
    assert (len(rig.live), channel.thinned) == (1, 2)
    rig.channels.demand({})
    rig.channels.demand({channel.channel_id: 0.0})
    rig.feed("/live", [(0.3, 20.0)])
    assert (len(rig.live), channel.thinned) == (2, 2)


async def test_of_an_outage_only_the_newest_is_kept() -> None:
    rig = Rig()
    channel = rig.channel("/latest")
    rig.feed("/latest", [(0.0, 1.0)])
    assert rig.counts("bulk") == {channel.channel_id: 1}
    rig.outbox.online = False
    rig.feed("/latest", [(float(i), float(i)) for i in range(1, 6)])
    assert (rig.counts("bulk_backfill"), channel.thinned) == ({}, 4)
    rig.outbox.online = True
    found: dict[int, int] = {}
    await wait_until_async(lambda: found.update(rig.counts("bulk")) or found)
    assert (found, channel.thinned) == ({channel.channel_id: 1}, 4)
    assert channel.channel_id | BACKFILL_BIT not in found
