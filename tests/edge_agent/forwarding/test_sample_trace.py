"""One sample in many is followed: which, what it tells, and what a batch without it looks like."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import re
from collections.abc import Sequence

import numpy as np
import pytest

from edge_agent.config.settings import load_settings
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from edge_agent.forwarding.sample_trace import Tracer
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.errors import ConfigError
from metaros.link import BACKFILL_BIT, batch_bytes
from tests.edge_agent.parts import accept
from tests.edge_agent.session_rig import SessionRig

STREAM = 7


def make(clock: ManualClock, *, every: int = 1) -> Tracer:
    return Tracer(clock, random.Random(5), every=every)


def stamps(*values: int) -> bytes:
    return np.asarray(values, "<i8").tobytes()


def sent(tracer: Tracer, first_seq: int, values: Sequence[int], stream: int = STREAM) -> link_pb2.Batch:
    return link_pb2.Batch.FromString(tracer.sent(stream, first_seq, stamps(*values)))


def test_a_followed_sample_tells_when_it_was_where() -> None:
    clock = ManualClock()
    tracer = make(clock)
    tracer.clock_offset_ns = lambda: -250
    start_ns, arrived_s = clock.wall_ns(), clock.monotonic_s()
    clock.advance(0.001)
    tracer.taken(STREAM, 42, arrived_s)
    assert tracer.follows(STREAM)
    assert tracer.follows(STREAM | BACKFILL_BIT)
    clock.advance(0.020)
    tracer.accepted({STREAM: [(41, b"a"), (42, b"b")], 8: [(42, b"c")]})
    clock.advance(0.005)
    assert not sent(tracer, 100, [40, 41]).HasField("trace"), "it is not in this batch"
    trace = sent(tracer, 102, [41, 42]).trace
    assert trace.seq == 103
    assert trace.tapped_ns == start_ns
    assert trace.taken_ns == start_ns + 1_000_000
    assert trace.accepted_ns == start_ns + 21_000_000
    assert trace.sent_ns == start_ns + 26_000_000
    assert trace.clock_offset_ns == -250
    assert re.fullmatch(r"00-[0-9a-f]{32}-[0-9a-f]{16}-01", trace.traceparent)
    assert not sent(tracer, 102, [41, 42]).HasField("trace"), "sent again it tells nothing"


def test_one_in_so_many_and_at_most_ten_a_second() -> None:
    clock = ManualClock()
    tracer = make(clock, every=100)
    found = 0
    for number in range(1000):
        tracer.taken(STREAM, number, clock.monotonic_s())
        found += sent(tracer, number, [number]).HasField("trace")
        clock.advance(0.01)
    assert found == 10
    busy, found = make(clock), 0
    for number in range(1000):
        busy.taken(STREAM, number, clock.monotonic_s())
        found += sent(busy, number, [number]).HasField("trace")
        clock.advance(0.001)
    assert found == 10


def test_none_is_followed_where_nobody_wants_it() -> None:
    tracer = make(ManualClock(), every=0)
    for number in range(10):
        tracer.taken(STREAM, number, 0.0)
    assert not tracer.follows(STREAM)


def test_a_sample_that_never_leaves_is_forgotten() -> None:
    clock = ManualClock()
    tracer = make(clock)
    tracer.taken(STREAM, 1, clock.monotonic_s())
    clock.advance(59)
    tracer.taken(STREAM, 2, clock.monotonic_s())
    assert not sent(tracer, 1, [2]).HasField("trace"), "one of a stream at a time"
    clock.advance(2)
    tracer.taken(STREAM, 3, clock.monotonic_s())
    assert sent(tracer, 1, [3]).HasField("trace")


def test_a_batch_with_a_trace_is_the_batch_and_its_trace() -> None:
    clock = ManualClock()
    tracer = make(clock)
    tracer.taken(STREAM, 1, clock.monotonic_s())
    columns = link_pb2.Batch(stamps=stamps(1), lengths=b"\3\0\0\0", payload=b"abc").SerializeToString()
    whole = batch_bytes(columns, stream_id=STREAM, epoch=5, first_seq=9, count=1)
    batch = link_pb2.Batch.FromString(whole + tracer.sent(STREAM, 9, stamps(1)))
    assert (batch.payload, batch.first_seq, batch.trace.seq) == (b"abc", 9, 9)


@pytest.mark.parametrize("topic", ["/live/a", "/bulk/a"])
def test_it_goes_from_the_tap_to_the_link_with_its_sample(topic: str) -> None:
    rig = SessionRig()
    rig.tracer = tracer = make(rig.clock)
    rig.outbox.on_accepted = tracer.accepted
    rig.linger = Linger(linger_s=0.0)
    rig.new_session()
    rig.connect()
    rig.channels.demand({channel.channel_id: 0.0 for channel in rig.channels})
    wakes = {"wake_writer": lambda: None, "wake_uplink": lambda: None}
    pipeline = Pipeline(rig.outbox, rig.live, rig.linger, **wakes, tracer=tracer)
    channel = next(item for item in rig.channels if item.topic == topic)
    pipeline.take([Arrival(channel, b"payload", 7, 1234, rig.clock.monotonic_s())], rig.clock.monotonic_s())
    rig.clock.advance(0.1)
    accept(rig.outbox)
    rig.clock.advance(0.1)
    written = iter(lambda: rig.session.next_frame(link_pb2.LANE_DATA), None)
    batches = [batch for data in written for batch in link_pb2.AgentFrame.FromString(data).batches.batches]
    (batch,) = [batch for batch in batches if batch.payload == b"payload"]
    assert batch.trace.seq == batch.first_seq
    assert (batch.trace.accepted_ns > 0) == (topic == "/bulk/a")
    assert batch.trace.sent_ns >= max(batch.trace.accepted_ns, batch.trace.taken_ns) > 0


def test_how_often_is_a_setting() -> None:
    assert load_settings(overrides={"trace_every": 0}).trace_every == 0
    for wrong in (-1, "often", True):
        with pytest.raises(ConfigError, match="trace_every"):
            load_settings(overrides={"trace_every": wrong})
