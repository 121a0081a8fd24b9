"""One lane's sender: what it holds back and why, and that waiting is never spinning."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.uplink.session import BACKFILL, CONTROL, DATA, LANES
from metaros._proto import link_pb2
from tests.edge_agent.parts import accept
from tests.edge_agent.session_rig import SessionRig
from tests.support.gateways.gateway_half import GatewayHalf, late_stream


def run(rig: SessionRig, seconds: float) -> int:
    """Serve all lanes by what they say of time alone; how many turns that took."""
    turns, end_s = 0, rig.clock.monotonic_s() + seconds
    while rig.clock.monotonic_s() < end_s:
        turns += 1
        rig.send()
        rig.gateway.ack()
        rig.deliver()
        waits = [wait_s for lane in LANES if (wait_s := rig.session.wait_s(lane)) is not None]
        rig.clock.advance(max(min(waits), 1e-6))
    return turns


def test_a_lane_that_is_asked_to_wait_sends_nothing_durable_and_then_everything_again() -> None:
    rig = SessionRig()
    rig.connect()
    rig.put("/bulk/a", b"lost on the way", "bulk")
    rig.gateway.refuse(DATA, 77, retry_after_ms=250)
    rig.send()
    assert rig.gateway.dropped == 1
    rig.deliver()
    rig.put("/bulk/a", b"more", "bulk")
    rig.put("/event/a", b"event", "event")
    rig.put("/live/a", b"live", "live")
    rig.clock.advance(0.1)
    rig.send()
    assert (rig.gateway.rows[2], rig.gateway.dropped) == ({}, 1)
    assert rig.gateway.rows[1] == {1: b"event"}, "another lane goes on"
    assert rig.gateway.live[4] == [(1, b"live")], "what is not stored goes on"
    wait_s = rig.session.wait_s(DATA)
    assert wait_s is not None
    assert 0 < wait_s <= 0.15
    rig.clock.advance(0.2)
    rig.send()
    assert rig.gateway.rows[2] == {1: b"lost on the way", 2: b"more"}
    assert (rig.gateway.dropped, rig.gateway.duplicates, rig.gateway.refusing) == (1, 0, {})


def test_what_was_acknowledged_before_the_pause_is_not_sent_again() -> None:
    rig = SessionRig()
    rig.connect()
    for number in range(3):
        rig.put("/bulk/a", bytes([number]), "bulk")
        rig.send()
    rig.gateway.ack()
    rig.gateway.refuse(DATA, 5)
    rig.deliver()
    rig.put("/bulk/a", b"after", "bulk")
    rig.clock.advance(1.0)
    rig.settle()
    assert (len(rig.gateway.rows[2]), rig.gateway.duplicates) == (4, 0)


def test_a_pause_opens_the_window_again() -> None:
    rig = SessionRig(GatewayHalf(window_batches=1))
    rig.connect()
    for number in range(3):
        rig.put("/bulk/a", bytes([number]), "bulk")
        accept(rig.outbox)
    rig.gateway.refuse(DATA, 5)
    rig.send()
    rig.deliver()
    rig.clock.advance(20.0)  # far longer than acknowledgements may take
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(heartbeat=link_pb2.Heartbeat(sent_ns=1, echo_ns=1)))
    rig.session.check()
    rig.settle()
    assert sorted(rig.gateway.rows[2]) == [1, 2, 3]


@pytest.mark.parametrize("limit", [2_000, 100_000, 5_000_000])
def test_a_budget_holds_back_without_spinning(limit: int) -> None:
    rig = SessionRig()
    rig.budget.set_limit(limit, rig.clock.monotonic_s())
    for _ in range(20):
        rig.put("/bulk/a", bytes(20_000), "bulk")
    accept(rig.outbox)
    rig.connect()
    for _ in range(20):
        rig.put("/bulk/b", bytes(20_000), "bulk")
        rig.put("/live/a", bytes(2_000), "live")
        rig.row(0.5)
    turns = run(rig, 5.0)
    assert turns < 12_000
    sent = sum(len(row) for rows in rig.gateway.rows.values() for row in rows.values() if isinstance(row, bytes))
    assert sent <= 5 * limit + 600_000  # a frame, and the burst, come on top


@pytest.mark.parametrize("limit", [2_000, 20_000])
def test_a_closed_window_and_a_spent_budget_wait_for_something(limit: int) -> None:
    rig = SessionRig(GatewayHalf(window_batches=1, window_bytes=10_000))
    rig.budget.set_limit(limit, rig.clock.monotonic_s())
    rig.connect()
    for _ in range(10):
        rig.put("/bulk/a", bytes(30_000), "bulk")
        rig.put("/event/a", bytes(3_000), "event")
    for _ in range(1_000):
        rig.send()
        waits = {lane: rig.session.wait_s(lane) for lane in LANES}
        assert all(wait_s is None or wait_s > 0 for wait_s in waits.values())
        rig.clock.advance(0.001)


def test_compression_is_where_it_saves_and_changes_nothing() -> None:
    rig = SessionRig()
    rig.compression = "zstd"
    rig.new_session()
    rig.connect()
    rng = random.Random(1)
    plain, noise = bytes(rng.choices(b"ab", k=50_000)), rng.randbytes(50_000)
    rig.put("/bulk/a", plain, "bulk")
    accept(rig.outbox)
    frame = rig.session.next_frame(DATA)
    while frame is not None and not link_pb2.AgentFrame.FromString(frame).HasField("batches"):
        rig.gateway.receive(DATA, link_pb2.AgentFrame.FromString(frame))
        frame = rig.session.next_frame(DATA)
    assert frame is not None
    assert len(frame) < 25_000
    rig.gateway.receive(DATA, link_pb2.AgentFrame.FromString(frame))
    rig.put("/bulk/a", noise, "bulk")
    rig.settle()
    assert rig.gateway.rows[2] == {1: plain, 2: noise}


def test_announcements_come_before_the_first_batch_of_every_lane() -> None:
    rig = SessionRig()
    for topic, delivery in (("/event/a", "event"), ("/bulk/a", "bulk")):
        rig.put(topic, b"x", delivery)
    accept(rig.outbox)
    rig.connect()
    rig.put("/bulk/a", b"y", "bulk")
    accept(rig.outbox)
    rig.clock.advance(0.1)  # back-fill has a budget even without a limit
    for lane in LANES:
        kinds = []
        while (frame := rig.session.next_frame(lane)) is not None:
            kinds.append(link_pb2.AgentFrame.FromString(frame).WhichOneof("frame"))
        assert kinds[0] == "announce"
        assert "batches" in kinds


def test_a_gap_and_pieces_keep_their_place_on_the_back_fill_lane() -> None:
    rig = SessionRig()
    large = bytes(range(256)) * 12_000
    rig.put("/bulk/a", b"first", "bulk")
    rig.outbox.give_up(2, "bulk", "too_large")
    rig.put("/bulk/a", large, "bulk")
    accept(rig.outbox)
    rig.connect()
    rig.settle()
    late = late_stream(2)
    assert rig.gateway.rows[late] == {1: b"first", 3: large}
    assert rig.gateway.gaps[late] == {2: "too_large"}
    assert BACKFILL in rig.gateway.out
