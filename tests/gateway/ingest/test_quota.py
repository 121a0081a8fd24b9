"""What one robot may send: the bucket, sessions under it, and a simulated world in which nothing is lost to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.ingest.events import Arrived, OverQuota, RowsArrived
from gateway.ingest.quota import BURST_S, MOST_WAIT_S, Meter, Quota
from gateway.ingest.session import Session
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from metaros.link import pack_batch, pack_metrics, split_sample
from tests.gateway.ingest.test_session import (
    BACKFILL,
    CONTROL,
    DATA,
    EPOCH,
    Rig,
    announce,
    closed,
    refusals,
)
from tests.support.simulation.link_sim import Parts, run_simulation
from tests.support.simulation.sim_gateway import Gateway

TIGHT = Quota(messages_per_s=60, bytes_per_s=4000)


class TightGateway(Gateway):
    """The simulated gateway, whose robots are always over their quota. Buckets outlive sessions, as they must."""

    put_offs = 0

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.meter = Meter(TIGHT, limits=self.limits)
        self.limits = replace(self.limits, window_bytes=min(self.limits.window_bytes, TIGHT.window_bytes(LIMITS)))

    def session_type(self, *arguments: Any, **options: Any) -> Session:  # type: ignore[override]
        """A session under the quota."""
        return Session(*arguments, meter=self.meter, **options)

    def apply(self, events: list[object]) -> None:
        """Count what was put off."""
        TightGateway.put_offs += sum(isinstance(event, OverQuota) and event.put_off for event in events)
        super().apply(events)


def test_nothing_is_lost_to_a_quota_whatever_else_happens() -> None:
    TightGateway.put_offs = 0
    for seed in range(12):
        run_simulation(seed, parts=Parts(gateway=TightGateway))
    assert TightGateway.put_offs > 12, "the quota was never met: the test shows nothing"


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["event", "bulk", "metric", "live"]),
            st.integers(1, 50),
            st.integers(1, 3000),
            st.floats(0, 2),
        ),
        min_size=1,
    )
)
@settings(max_examples=40)
def test_what_is_taken_stays_below_the_rate(steps: list[tuple[str, int, int, float]]) -> None:
    meter, now_s = Meter(TIGHT, limits=LIMITS), 0.0
    messages = size_bytes = 0
    for delivery, count, size, pause_s in steps:
        now_s += pause_s
        if meter.take(count, size, delivery, now_s) == 0:
            messages, size_bytes = messages + count, size_bytes + size
    # A full bucket at first, as deep again for events, and one batch that overdraws it.
    assert messages <= TIGHT.messages_per_s * (now_s + 2 * BURST_S) + 50
    assert size_bytes <= TIGHT.bytes_per_s * (now_s + 2 * BURST_S) + 3000


@pytest.mark.parametrize("delivery", ["event", "bulk", "metric", "live"])
def test_who_waits_so_long_gets_through(delivery: str) -> None:
    meter = Meter(TIGHT, limits=LIMITS)
    while (wait_s := meter.take(7, 300, delivery, 0.0)) == 0:
        pass
    assert 0 < wait_s < MOST_WAIT_S
    assert meter.take(1, 1, delivery, wait_s - 0.5) > 0 or delivery in ("event", "bulk", "metric")
    assert meter.take(1, 1, delivery, wait_s + 0.001) == 0


def test_live_leaves_durable_samples_their_half_and_events_come_first() -> None:
    meter = Meter(Quota(messages_per_s=100), limits=LIMITS)
    taken = dict.fromkeys(("live", "bulk", "event"), 0)
    for name in taken:
        while meter.take(1, 1, name, 0.0) == 0:
            taken[name] += 1
    assert taken == {"live": 100, "bulk": 100, "event": 200}


def test_no_quota_is_no_limit() -> None:
    meter = Meter(Quota(), limits=LIMITS)
    assert all(meter.take(4096, LIMITS.sample_bytes, "live", 0.0) == 0 for _ in range(1000))
    assert Quota().window_bytes(LIMITS) == LIMITS.window_bytes


def test_a_clock_that_stands_still_or_a_claim_of_any_size_cannot_harm() -> None:
    meter = Meter(TIGHT, limits=LIMITS)
    assert meter.take(2**32 - 1, 2**63, "bulk", 5.0) == 0
    assert meter.take(1, 1, "bulk", 5.0) == MOST_WAIT_S
    assert meter.take(1, 1, "bulk", 4.0) == MOST_WAIT_S
    assert meter.take(1, 1, "bulk", 5.0 + LIMITS.sample_bytes / TIGHT.bytes_per_s + 1) == 0


def tight_rig(**quota: float) -> Rig:
    """A session with all lanes, under a quota."""
    rig = Rig()
    rig.session._meter = Meter(Quota(**quota), limits=LIMITS)
    return rig


def test_a_lane_over_its_quota_waits_and_the_others_go_on() -> None:
    rig = tight_rig(messages_per_s=100)
    assert isinstance(rig.samples(1, 200)[0], Arrived)
    over, reported = rig.samples(201, 10)
    assert over == OverQuota(put_off=True)
    later = reported.frame.retry_later
    assert (reported.lane, later.reason, later.retry_after_ms) == (DATA, "rate", 1000)
    assert rig.samples(211, 10) == [], "what was under way is dropped, without a word"
    assert rig.streams.accepted(1, EPOCH) == 200, "what was taken in stays taken in"
    rig.receive(announce=announce(3, 1), lane=CONTROL)
    assert isinstance(rig.samples(1, 50, stream=3, lane=CONTROL)[0], Arrived), "an event goes before"
    rig.clock.advance(2)
    rig.receive(resumed=link_pb2.Resumed(token=later.token))
    (again,) = rig.samples(201, 20)
    assert (again.duplicates, again.seq) == (0, 220)


def test_rows_are_metered_like_samples() -> None:
    rig = tight_rig(messages_per_s=100)
    numbers = range(250)
    (rows,) = rig.receive(metrics=pack_metrics(EPOCH, 1, [1] * 250, list(numbers), [0.0] * 250))
    assert isinstance(rows, RowsArrived)
    events = rig.receive(metrics=pack_metrics(EPOCH, 251, [1], [1], [0.0]))
    assert set(refusals(events)) == {DATA}


def test_live_over_the_quota_is_dropped_and_counted() -> None:
    rig = tight_rig(messages_per_s=100)
    assert isinstance(rig.samples(1, 100, stream=2)[0], Arrived)
    assert rig.samples(101, 30, stream=2) == [OverQuota(dropped=30)]
    assert isinstance(rig.samples(1, 1)[0], Arrived), "bulk has its half"


@pytest.mark.parametrize(("stream", "lane"), [(1, DATA), (1, BACKFILL), (2, DATA)])
def test_a_large_sample_is_paid_for_once_and_never_half(stream: int, lane: int) -> None:
    rig = tight_rig(bytes_per_s=1 << 20)
    if lane == BACKFILL:
        stream |= 1 << 31
    for seq in (1, 2):
        pieces = [link_pb2.Batches(batches=[piece]) for piece in split_sample(stream, EPOCH, seq, 5, bytes(5 << 20))]
        arrived = [event for piece in pieces for event in rig.receive(lane=lane, batches=piece)]
        assert closed(arrived) is None
        if seq == 1:
            assert [type(event) for event in arrived] == [Arrived]
        elif stream == 2:
            assert sum(event.dropped for event in arrived) == 1
        else:
            assert (arrived[0], set(refusals(arrived))) == (OverQuota(put_off=True), {lane})
    rig.clock.advance(10)
    assert closed(rig.samples(7, 1, stream=2)) is None, "the next sample of the stream comes as ever"


def test_a_refusal_in_the_middle_of_a_large_live_sample_leaves_it_whole() -> None:
    rig = Rig()
    pieces = list(split_sample(2, EPOCH, 1, 5, bytes(3 << 20)))
    rig.receive(batches=link_pb2.Batches(batches=pieces[:1]))
    rig.session.refuse("store_error", retry_after_ms=250)
    (arrived,) = rig.receive(batches=link_pb2.Batches(batches=pieces[1:]))
    assert isinstance(arrived, Arrived)


def test_a_piece_for_free_is_no_way_around() -> None:
    rig = tight_rig(bytes_per_s=1000)
    batch = pack_batch(1, EPOCH, 1, [1], [bytes(100)])
    batch.chunk_index, batch.chunk_count = 1, 2
    assert closed(rig.receive(batches=link_pb2.Batches(batches=[batch]))) == "protocol"
