"""The live queue is bounded and counts what it drops."""

from __future__ import annotations

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.live_queue import OVERHEAD_BYTES, LiveQueue
from tests.edge_agent.parts import make_outbox


def test_oldest_yields_and_is_counted() -> None:
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/")
    a = channels.observe("/a", "std_msgs/msg/String", "RIHS01_x", qos="", keeps_all=False)
    b = channels.observe("/b", "std_msgs/msg/String", "RIHS01_x", qos="", keeps_all=False)
    assert a is not None
    assert b is not None
    live = LiveQueue(max_bytes=3 * (OVERHEAD_BYTES + 1))
    for stamp in range(2):
        live.append(a, stamp, b"a")
        live.append(b, stamp, b"b")
    assert (a.dropped, b.dropped, len(live), live.dropped) == (1, 0, 3, 1)
    assert live.size_bytes <= live.max_bytes
    runs = live.take(1 << 20)
    assert {stream: [sample.seq for sample in run] for stream, run in runs.items()} == {1: [2], 2: [1, 2]}
    assert (len(live), live.size_bytes) == (0, 0)


def test_take_is_bounded_but_never_empty_handed() -> None:
    channel = Channels(TopicTable(), make_outbox().ids, namespace="/").observe(
        "/a", "a/msg/B", "x", qos="", keeps_all=False
    )
    assert channel is not None
    live = LiveQueue()
    for stamp in range(3):
        live.append(channel, stamp, bytes(1000))
    assert [len(run) for run in live.take(10).values()] == [1]
    live.clear()
    assert (channel.dropped, live.dropped, len(live), live.size_bytes) == (2, 2, 0, 0)
    assert live.take(10) == {}
