"""Reading this host."""

from __future__ import annotations

import math

import pytest

from edge_agent.channels import Channels
from edge_agent.metrics import HOST_TOPICS, HostReader, HostTopic, read_all, topic_rates
from edge_agent.topics import TopicTable
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.idl import message_class
from tests.edge_agent.parts import make_outbox


@pytest.mark.parametrize("item", HOST_TOPICS, ids=lambda item: item.topic)
def test_every_reading_fits_its_message(item: HostTopic) -> None:
    reading = item.read(HostReader(ManualClock()))
    message = message_class(item.type_name)(**reading)
    again = codec(item.type_name).decode(codec(item.type_name).encode(message))
    for name, value in reading.items():
        if isinstance(value, float) and math.isnan(value):
            assert math.isnan(getattr(again, name))
        else:
            assert getattr(again, name) == pytest.approx(value)


def test_values_are_plausible() -> None:
    reader = HostReader(ManualClock())
    assert 0 <= reader.cpu()["percent"] <= 100
    memory = reader.memory()
    assert 0 < memory["used_bytes"] < memory["total_bytes"]
    assert 0 <= reader.disk()["percent"] <= 100


def test_rates_are_per_second_and_never_negative() -> None:
    clock = ManualClock()
    reader = HostReader(clock)
    assert reader._rates("x", 100, 1000) == (0.0, 0.0)
    clock.advance(2.0)
    assert reader._rates("x", 300, 900) == (100.0, 0.0)


def test_what_cannot_be_read_is_left_out() -> None:
    def broken(_: HostReader) -> dict[str, object]:
        raise PermissionError("no")

    unreadable: set[str] = set()
    topics = (HostTopic("host/x", "a/msg/A", broken), HOST_TOPICS[1])
    readings = read_all(HostReader(ManualClock()), topics, unreadable)
    assert [item.topic for item, _ in readings] == ["host/memory"]
    assert unreadable == {"host/x"}


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
