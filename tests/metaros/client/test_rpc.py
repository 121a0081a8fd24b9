"""What the clients make of gRPC's replies and errors, without a gateway."""

from __future__ import annotations

import pytest

from metaros._proto import events_pb2, telemetry_pb2
from metaros.cdr import codec
from metaros.client import Sample, Values
from metaros.client.rpc import EventPosition, Samples
from metaros.idl import schema_text, type_hash
from metaros.idl.json import from_json

STRING = "std_msgs/msg/String"


def test_events_go_on_behind_the_last_one_that_came() -> None:
    place = EventPosition(None, "robot.*", ["r1"])
    assert not place.request().HasField("after"), "from now on"
    assert list(place.events(events_pb2.WatchEventsReply(next=7))) == []
    assert place.request().after == 7, "where it began, though nothing has happened"
    reported = events_pb2.WatchEventsReply(
        events=[events_pb2.Event(cursor=number, kind="robot.online", data_json='{"a": 1}') for number in (8, 9)],
        next=12,
    )
    pages = place.events(reported)
    first = next(pages)
    assert (first.cursor, first.data) == (8, {"a": 1})
    assert place.request().after == 8, "the second one was not taken yet"
    assert [event.cursor for event in pages] == [9]
    assert place.request().after == 12
    assert list(place.request().filter.kinds) == ["robot.*"]


def info(number: int, type_name: str = STRING, **more: object) -> telemetry_pb2.ChannelInfo:
    """A channel as the gateway introduces it."""
    facts = {"type_hash": type_hash(STRING), "encoding": "cdr", **more}
    return telemetry_pb2.ChannelInfo(channel=number, robot="r1", topic="/t", type_name=type_name, **facts)


@pytest.mark.parametrize(
    ("channel", "shown"),
    [
        (info(1), "hello"),
        (info(1, "my_msgs/msg/Text", type_hash="", schema=schema_text(STRING).encode()), "hello"),
        (info(1, "my_msgs/msg/Unknown", type_hash=""), None),
        (info(1, encoding="sealed/cdr"), None),
    ],
    ids=["shipped", "of the robot", "unknown", "sealed"],
)
def test_a_message_is_decoded_where_its_type_is_known(channel: telemetry_pb2.ChannelInfo, shown: str | None) -> None:
    payload = codec(STRING).encode(from_json(STRING, {"data": "hello"}))
    samples = Samples(decode=True)
    reply = telemetry_pb2.SubscribeReply(channel=1, info=channel, dropped=3)
    assert list(samples.live(reply)) == []
    (sample,) = samples.live(
        telemetry_pb2.SubscribeReply(channel=1, samples=[telemetry_pb2.Sample(seq=5, cdr=payload)])
    )
    assert isinstance(sample, Sample)
    assert (sample.seq, sample.cdr, samples.dropped) == (5, payload, 3)
    assert (sample.message.data if sample.message is not None else None) == shown


def test_bytes_that_are_no_such_message_are_handed_on_undecoded() -> None:
    samples = Samples(decode=True)
    stored = telemetry_pb2.QueryReply(channels=[info(4)], samples=[telemetry_pb2.Sample(channel=4, cdr=b"\x00")])
    (sample,) = samples.stored(stored)
    assert (sample.message, sample.cdr) == (None, b"\x00")


def test_values_of_series() -> None:
    values = telemetry_pb2.SeriesValues(robot="r1", stamp_ns=3, values={"a": 1.5})
    assert list(Samples(decode=True).live(telemetry_pb2.SubscribeReply(values=[values]))) == [
        Values("r1", 3, {"a": 1.5})
    ]
