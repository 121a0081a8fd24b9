"""What the agent's tap sees, as rates."""

from __future__ import annotations

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.host_metrics import topic_rates
from tests.edge_agent.parts import make_outbox


def test_topic_rates_count_between_calls() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    channel = channels.observe("/a", "a/msg/A", "x", qos="", keeps_all=False)
    assert channel is not None
    before: dict[int, tuple[int, int]] = {}
    channel.messages, channel.size_bytes = 10, 100
    assert topic_rates(channels, before)[0].rate_hz == 10.0
    channel.messages, channel.size_bytes = 15, 300
    (rate,) = topic_rates(channels, before)
    assert (rate.rate_hz, rate.bytes_per_s, rate.messages, rate.topic) == (5.0, 200.0, 15, "/a")
