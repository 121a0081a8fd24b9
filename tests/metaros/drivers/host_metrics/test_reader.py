"""Reading this host."""

from __future__ import annotations

import math

import pytest

from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.drivers.host_metrics.reader import HOST_TOPICS, HostReader, HostTopic, read_all
from metaros.idl import message_class


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
