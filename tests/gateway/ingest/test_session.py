"""The gateway's half of a session, without any I/O: sequences, gaps, duplicates, silence, garbage."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.errors import ForkedError, ProtocolError
from gateway.ingest.events import (
    Announced,
    Arrived,
    Closed,
    GapDeclared,
    Measured,
    Online,
    RowsArrived,
    Send,
    WriterKnown,
)
from gateway.ingest.session import Session
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.link import BACKFILL_BIT, pack_batch, pack_metrics, split_sample

CONTROL, DATA, BACKFILL = LANES = (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL)
EPOCH = 2**64 - 1


def hello(lane: int = CONTROL, **changes: Any) -> link_pb2.Hello:
    """A good Hello."""
    good = {"protocol": 1, "robot_id": "r1", "session_id": b"0" * 16, "session_number": 7, "namespace": "/r1"}
    return link_pb2.Hello(**{**good, "lane": lane, **changes})


class Rig:
    """A session with all lanes open and two announced channels: 1 bulk, 2 live."""

    def __init__(self, streams: StreamTable | None = None) -> None:
        self.clock = ManualClock()
        self.streams = streams if streams is not None else StreamTable()
        self.session = Session(hello(), self.streams, gateway_id="g", store_id="s")
        self.opened = [event for lane in LANES for event in self.open(lane)]
        self.receive(announce=announce(1, 3), lane=DATA)
        self.receive(announce=announce(2, 4), lane=DATA)

    def open(self, lane: int, **changes: Any) -> list[Any]:
        times = {"now_s": self.clock.monotonic_s(), "wall_ns": self.clock.wall_ns()}
        return self.session.open_lane(hello(lane, **changes), **times)

    def receive(self, *, lane: int = DATA, **frame: Any) -> list[Any]:
        times = {"now_s": self.clock.monotonic_s(), "wall_ns": self.clock.wall_ns()}
        return self.session.receive(lane, link_pb2.AgentFrame(**frame), **times)

    def samples(
        self, first_seq: int, count: int, *, stream: int = 1, epoch: int = EPOCH, lane: int = DATA
    ) -> list[Any]:
        payloads = [f"{first_seq + index}".encode() for index in range(count)]
        batch = pack_batch(stream, epoch, first_seq, list(range(count)), payloads)
        return self.receive(lane=lane, batches=link_pb2.Batches(batches=[batch]))

    def tick(self) -> list[Any]:
        return self.session.tick(now_s=self.clock.monotonic_s(), wall_ns=self.clock.wall_ns())


def announce(number: int, delivery: int) -> link_pb2.Announce:
    """One channel of std_msgs/msg/String and one series."""
    channel = link_pb2.Channel(
        channel_id=number, topic=f"/r1/t{number}", schema_name="std_msgs/msg/String", forward=True
    )
    setattr(channel, "class", delivery)
    return link_pb2.Announce(channels=[channel], series=[link_pb2.Series(series_id=number, name=f"t{number}.x")])


def closed(events: list[Any]) -> str | None:
    """The code a session ended with, if it did."""
    return next((event.code for event in events if isinstance(event, Closed)), None)


def test_all_lanes_are_welcomed_and_make_the_robot_online() -> None:
    rig = Rig()
    welcomes = [
        event.frame.welcome for event in rig.opened if isinstance(event, Send) and event.frame.HasField("welcome")
    ]
    assert [(w.gateway_id, w.store_id, w.window_batches) for w in welcomes] == [("g", "s", 256)] * 3
    assert sum(isinstance(event, Online) for event in rig.opened) == 1


def test_two_lanes_are_not_enough() -> None:
    session = Session(hello(), StreamTable(), gateway_id="g", store_id="s")
    events = [e for lane in (CONTROL, DATA) for e in session.open_lane(hello(lane), now_s=0, wall_ns=0)]
    assert not session.online
    assert not any(isinstance(event, Online) for event in events)


@pytest.mark.parametrize(
    "changes",
    [
        {"protocol": 2},
        {"robot_id": ""},
        {"robot_id": "a/b"},
        {"robot_id": "x" * 65},
        {"session_id": b"short"},
        {"lane": 0},
        {"lane": 4},
        {"writers": [""]},
        {"writers": ["w"] * 1000},
        {"streams": [link_pb2.StreamState(stream_id=1, epoch=1, base_seq=5, last_seq=4)]},
        {"namespace": "no slash"},
        {"hostname": "h" * 300},
        {"labels": {str(n): "" for n in range(40)}},
        {"session_number": 2**63},
    ],
)
def test_bad_hello_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ProtocolError):
        Session(hello(**changes), StreamTable(), gateway_id="g", store_id="s")


def test_a_lane_opens_once() -> None:
    with pytest.raises(ProtocolError):
        Rig().open(DATA)


def test_samples_arrive_and_watermark_moves() -> None:
    rig = Rig()
    (arrived,) = rig.samples(1, 3)
    assert (arrived.seq, arrived.durable, arrived.duplicates) == (3, True, 0)
    assert [(s.seq, s.stamp_ns, bytes(s.payload)) for s in arrived.run.samples()] == [
        (1, 0, b"1"),
        (2, 1, b"2"),
        (3, 2, b"3"),
    ]
    assert rig.streams.accepted(1, EPOCH) == 3
    assert rig.streams.stored(1, EPOCH) == 0


def test_duplicates_are_cut_off_and_counted() -> None:
    rig = Rig()
    rig.samples(1, 3)
    (arrived,) = rig.samples(2, 4)
    assert (arrived.duplicates, arrived.seq) == (2, 5)
    assert [bytes(s.payload) for s in arrived.run.samples()] == [b"4", b"5"]
    (again,) = rig.samples(1, 5)
    assert (again.duplicates, again.seq, again.run.count) == (5, 5, 0)


def test_a_hole_needs_a_gap() -> None:
    rig = Rig()
    assert closed(rig.samples(2, 1)) == "protocol"
    rig = Rig()
    gap = link_pb2.Gap(stream_id=1, epoch=EPOCH, from_seq=1, to_seq=9, reason="outbox_full")
    (declared,) = rig.receive(gap=gap)
    assert isinstance(declared, GapDeclared)
    assert declared.gap.count == 9
    assert rig.receive(gap=gap) == []
    (arrived,) = rig.samples(10, 1)
    assert arrived.seq == 10
    assert closed(rig.receive(gap=link_pb2.Gap(stream_id=1, epoch=EPOCH, from_seq=12, to_seq=12))) == "protocol"


def test_a_new_epoch_starts_at_one() -> None:
    rig = Rig()
    rig.samples(1, 5)
    (arrived,) = rig.samples(1, 1, epoch=5)
    assert (arrived.seq, arrived.duplicates) == (1, 0)


def test_live_sequences_may_have_holes() -> None:
    rig = Rig()
    for first in (900, 5, 7000):
        (arrived,) = rig.samples(first, 1, stream=2)
        assert (arrived.durable, arrived.run.count) == (False, 1)


def test_metric_rows_resume_by_watermark() -> None:
    rig = Rig()
    (rows,) = rig.receive(metrics=pack_metrics(EPOCH, 1, [1, 2, 1], [10, 20, 30], [0.5, 1.5, 2.5]))
    assert isinstance(rows, RowsArrived)
    assert [rows.rows.series[i].name for i in rows.rows.index] == ["t1.x", "t2.x", "t1.x"]
    (rows,) = rig.receive(metrics=pack_metrics(EPOCH, 2, [2, 1, 2], [20, 30, 40], [1.5, 2.5, 3.5]))
    assert (rows.duplicates, rows.seq, rows.rows.values.tolist()) == (2, 4, [3.5])
    assert closed(rig.receive(metrics=pack_metrics(EPOCH, 5, [9], [1], [1.0]))) == "protocol"


def test_welcome_tells_what_is_stored_not_what_is_queued() -> None:
    streams = StreamTable({(1, EPOCH): 4})
    rig = Rig(streams)
    rig.samples(5, 2)
    again = Session(hello(session_number=8), streams, gateway_id="g", store_id="s")
    state = link_pb2.StreamState(stream_id=1, epoch=EPOCH, first_seq=5, last_seq=6)
    (welcome,) = again.open_lane(hello(DATA, session_number=8, streams=[state]), now_s=0, wall_ns=0)
    assert welcome.frame.welcome.watermarks[0].seq == 4
    streams.commit(1, EPOCH, 6)
    assert streams.stored(1, EPOCH) == 6


def test_what_the_agent_no_longer_holds_is_a_gap() -> None:
    streams = StreamTable({(1, EPOCH): 4})
    session = Session(hello(), streams, gateway_id="g", store_id="s")
    state = link_pb2.StreamState(stream_id=1, epoch=EPOCH, first_seq=8, last_seq=9)
    events = session.open_lane(hello(DATA, streams=[state]), now_s=0, wall_ns=0)
    (gap,) = [event for event in events if isinstance(event, GapDeclared)]
    assert (gap.gap.from_seq, gap.gap.to_seq, gap.gap.reason) == (5, 7, "not_held")


def test_large_sample_comes_in_pieces() -> None:
    rig = Rig()
    payload = bytes(range(256)) * 12_000
    *pieces, last = split_sample(1, EPOCH, 1, 5, payload)
    for piece in pieces:
        assert rig.receive(batches=link_pb2.Batches(batches=[piece])) == []
    (arrived,) = rig.receive(batches=link_pb2.Batches(batches=[last]))
    assert bytes(next(arrived.run.samples()).payload) == payload


def test_commits_are_acknowledged_on_the_data_lane() -> None:
    (send,) = Rig().session.committed([(1, EPOCH, 3), (0, EPOCH, 9)])
    assert send.lane == DATA
    assert [(mark.stream_id, mark.seq) for mark in send.frame.ack.watermarks] == [(1, 3), (0, 9)]


def test_heartbeats_and_round_trip() -> None:
    rig = Rig()
    first = next(e.frame.heartbeat for e in rig.opened if isinstance(e, Send) and e.frame.HasField("heartbeat"))
    rig.clock.advance(0.2)
    (measured,) = rig.receive(
        lane=CONTROL, heartbeat=link_pb2.Heartbeat(sent_ns=1, echo_ns=first.sent_ns, held_ns=150_000_000)
    )
    assert isinstance(measured, Measured)
    assert measured.rtt_s == pytest.approx(0.05)
    assert rig.tick() == []
    rig.clock.advance(5)
    (beat,) = rig.tick()
    assert (beat.frame.heartbeat.echo_ns, beat.frame.heartbeat.held_ns) == (1, 5_000_000_000)


def test_silence_kills_after_fifteen_seconds_and_one_lane_is_enough_to_live() -> None:
    rig = Rig()
    rig.clock.advance(14)
    assert closed(rig.tick()) is None
    rig.receive(lane=CONTROL, heartbeat=link_pb2.Heartbeat(sent_ns=1))
    rig.clock.advance(14.9)
    assert closed(rig.tick()) is None
    rig.clock.jump_wall(-1e6)
    rig.clock.advance(0.2)
    events = rig.tick()
    assert closed(events) == "dead"
    assert rig.tick() == []
    assert rig.samples(1, 1) == []


def test_a_channel_number_never_changes_its_topic() -> None:
    rig = Rig()
    changed = announce(1, 3)
    changed.channels[0].topic = "/r1/other"
    assert closed(rig.receive(announce=changed)) == "protocol"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("topic", "no slash"),
        ("topic", "/a b"),
        ("schema_name", "String"),
        ("channel_id", 0),
        ("class", 0),
        ("max_rate_hz", -1.0),
        ("schema", bytes(1 << 20)),
    ],
)
def test_bad_announcements_name_the_field(field: str, value: Any) -> None:
    bad = announce(5, 3)
    setattr(bad.channels[0], field, value)
    events = Rig().receive(announce=bad)
    assert closed(events) == "protocol"


@given(st.binary(max_size=300))
@settings(max_examples=60)
def test_any_frame_is_accepted_or_ends_the_session(data: bytes) -> None:
    frame = link_pb2.AgentFrame()
    try:
        frame.ParseFromString(data)
    except Exception:
        return
    rig = Rig()
    events = rig.session.receive(DATA, frame, now_s=0.0, wall_ns=0)
    assert closed(events) in (None, "protocol")


@given(
    st.lists(
        st.builds(
            link_pb2.Batch,
            stream_id=st.integers(0, 3),
            epoch=st.just(EPOCH),
            first_seq=st.integers(0, 2**64 - 1),
            count=st.integers(0, 2**32 - 1) | st.integers(0, 3),
            stamps=st.binary(max_size=24),
            lengths=st.binary(max_size=12),
            payload=st.binary(max_size=32),
            chunk_index=st.integers(0, 3),
            chunk_count=st.integers(0, 3),
        ),
        max_size=4,
    )
)
@settings(max_examples=60)
def test_any_batch_keeps_the_watermark_whole(batches: list[link_pb2.Batch]) -> None:
    rig = Rig()
    rig.samples(1, 2)
    before = rig.streams.accepted(1, EPOCH)
    events = rig.receive(batches=link_pb2.Batches(batches=batches))
    fresh = sum(e.run.count for e in events if isinstance(e, Arrived) and e.durable)
    assert closed(events) in (None, "protocol")
    assert rig.streams.accepted(1, EPOCH) == before + fresh or closed(events) == "protocol"


def test_back_fill_is_kept_apart_from_what_is_fresh() -> None:
    rig = Rig()
    (fresh,) = rig.samples(1, 2)
    (late,) = rig.samples(1, 2, stream=1 | BACKFILL_BIT, lane=BACKFILL)
    assert (fresh.fresh, late.fresh) == (True, False)
    assert (fresh.run.channel, late.run.channel.channel_id) == (late.run.channel, 1)
    assert (rig.streams.accepted(1, EPOCH), rig.streams.accepted(1 | BACKFILL_BIT, EPOCH)) == (2, 2)
    rows = pack_metrics(EPOCH, 1, [1], [10], [0.5])
    rows.stream_id = BACKFILL_BIT
    (late_rows,) = rig.receive(lane=BACKFILL, metrics=rows)
    assert (late_rows.stream_id, late_rows.fresh, late_rows.seq) == (BACKFILL_BIT, False, 1)


def refusals(events: list[Any]) -> dict[int, link_pb2.RetryLater]:
    """Lane -> what it was told."""
    return {
        event.lane: event.frame.retry_later
        for event in events
        if isinstance(event, Send) and event.frame.HasField("retry_later")
    }


def test_what_the_store_cannot_take_is_asked_for_again() -> None:
    rig = Rig()
    rig.samples(1, 5)
    rig.streams.commit(1, EPOCH, 2)
    reported = refusals(rig.session.refuse("store_full", retry_after_ms=250))
    assert set(reported) == set(LANES)
    assert {(later.retry_after_ms, later.reason) for later in reported.values()} == {(250, "store_full")}
    assert len({later.token for later in reported.values()}) == 3
    assert rig.streams.accepted(1, EPOCH) == 2
    assert rig.samples(6, 2) == [], "it is dropped, and no hole in the numbers"
    assert rig.receive(metrics=pack_metrics(EPOCH, 1, [1], [10], [0.5])) == []
    assert rig.receive(gap=link_pb2.Gap(stream_id=1, epoch=EPOCH, from_seq=8, to_seq=9)) == []
    assert rig.samples(7, 1, stream=2)[0].durable is False, "live goes on"
    assert rig.session.refuse("store_full", retry_after_ms=250) == [], "once, until it is resumed"
    rig.receive(resumed=link_pb2.Resumed(token=reported[DATA].token + 7))
    assert rig.samples(3, 1) == [], "not with another token"
    rig.receive(resumed=link_pb2.Resumed(token=reported[DATA].token))
    (again,) = rig.samples(3, 4)
    assert (again.duplicates, again.seq) == (0, 6)
    assert rig.samples(1, 1, stream=1 | BACKFILL_BIT, lane=BACKFILL) == [], "each lane for itself"
    assert set(refusals(rig.session.refuse("store_full", retry_after_ms=250))) == {DATA}


def test_a_copy_of_the_outbox_is_found_out() -> None:
    streams = StreamTable(writers={EPOCH: "w2"})
    state = link_pb2.StreamState(stream_id=1, epoch=EPOCH, first_seq=1, last_seq=9)
    session = Session(hello(), streams, gateway_id="g", store_id="s")
    with pytest.raises(ForkedError):
        session.open_lane(hello(DATA, streams=[state], writers=["w1", "x"]), now_s=0, wall_ns=0)
    events = session.open_lane(hello(DATA, streams=[state], writers=["w1", "w2", "w3"]), now_s=0, wall_ns=0)
    assert [event.writers for event in events if isinstance(event, WriterKnown)] == [{EPOCH: "w3"}]


def test_a_stream_under_a_new_epoch_begins_after_its_base() -> None:
    session = Session(hello(), StreamTable(), gateway_id="g", store_id="s")
    state = link_pb2.StreamState(stream_id=1, epoch=EPOCH, first_seq=8, last_seq=9, base_seq=7)
    events = session.open_lane(hello(DATA, streams=[state]), now_s=0, wall_ns=0)
    assert [event for event in events if isinstance(event, GapDeclared)] == []
    (welcome,) = [event.frame.welcome for event in events if isinstance(event, Send)]
    assert [mark.seq for mark in welcome.watermarks] == [7]


def test_announced_event_carries_what_was_declared() -> None:
    (event,) = Rig().receive(announce=announce(5, 1))
    assert isinstance(event, Announced)
    assert (event.channels[0].delivery, event.series[0].name) == ("event", "t5.x")


@pytest.mark.parametrize(
    "changes",
    [{"history": True, "class": 4}, {"history_rate_hz": -1.0, "class": 4}, {"history_rate_hz": 1e400, "class": 4}],
)
def test_a_history_channel_that_cannot_be_ends_the_session(changes: dict[str, Any]) -> None:
    rig = Rig()
    channel = link_pb2.Channel(channel_id=5, topic="/r1/a", schema_name="std_msgs/msg/String", **changes)
    assert closed(rig.receive(announce=link_pb2.Announce(channels=[channel]))) == "protocol"


def test_a_number_stays_history_or_not() -> None:
    rig = Rig()
    channel = link_pb2.Channel(channel_id=1, topic="/r1/t1", schema_name="std_msgs/msg/String", history=True)
    setattr(channel, "class", 3)
    assert closed(rig.receive(announce=link_pb2.Announce(channels=[channel]))) == "protocol"


def test_a_session_whose_other_lanes_do_not_come_ends_however_alive_it_is() -> None:
    clock = ManualClock()
    session = Session(hello(), StreamTable(), gateway_id="g", store_id="s")
    session.open_lane(hello(), now_s=clock.monotonic_s(), wall_ns=0)
    for _ in range(60):
        beat = link_pb2.AgentFrame(heartbeat=link_pb2.Heartbeat(sent_ns=1))
        session.receive(CONTROL, beat, now_s=clock.monotonic_s(), wall_ns=0)
        assert not any(isinstance(item, Closed) for item in session.tick(now_s=clock.monotonic_s(), wall_ns=0))
        clock.advance(1.0)
    *_, closed = session.tick(now_s=clock.monotonic_s(), wall_ns=0)
    assert isinstance(closed, Closed)
    assert closed.code == "split"
