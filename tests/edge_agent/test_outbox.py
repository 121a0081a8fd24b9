"""The outbox: whatever happens, acknowledged, held and lost numbers make 1..last without overlap."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from edge_agent.outbox import OVERHEAD_BYTES, ClassPolicy, Gap, Outbox, Sample
from metaros.clock import ManualClock
from metaros.errors import FrameError

EPOCH = 99
SMALL = {
    "event": ClassPolicy(10 * (OVERHEAD_BYTES + 1), "newest"),
    "metric": ClassPolicy(10 * OVERHEAD_BYTES, "oldest"),
    "bulk": ClassPolicy(10 * (OVERHEAD_BYTES + 1), "oldest"),
}
STREAMS = {0: "metric", 1: "bulk", 2: "bulk", 3: "event"}


def make() -> Outbox:
    return Outbox(ManualClock(), EPOCH, classes=SMALL)


def take_all(outbox: Outbox, stream_id: int) -> list[Sample | Gap]:
    taken: list[Sample | Gap] = []
    while True:
        run = outbox.take(stream_id, max_bytes=1000, max_samples=3)
        if run is None:
            return taken
        taken += [run] if isinstance(run, Gap) else run


def numbers(items: list[Sample | Gap]) -> list[int]:
    flat: list[int] = []
    for item in items:
        flat += [item.seq] if isinstance(item, Sample) else range(item.from_seq, item.to_seq + 1)
    return flat


def test_numbers_start_at_one_and_are_sent_in_order() -> None:
    outbox = make()
    assert [outbox.append(1, "bulk", 10 + i, b"x") for i in range(5)] == [1, 2, 3, 4, 5]
    assert numbers(take_all(outbox, 1)) == [1, 2, 3, 4, 5]
    assert outbox.take(1, max_bytes=10, max_samples=10) is None
    assert outbox.sample_count == 5


def test_ack_frees_and_a_new_session_resends_the_rest() -> None:
    outbox = make()
    for i in range(6):
        outbox.append(1, "bulk", i, b"x")
    take_all(outbox, 1)
    outbox.acknowledge(1, EPOCH, 2)
    assert outbox.sample_count == 4
    outbox.resume({1: 4})
    assert numbers(take_all(outbox, 1)) == [5, 6]
    outbox.acknowledge(1, EPOCH, 6)
    assert (outbox.sample_count, outbox.size_bytes) == (0, 0)


def test_a_run_is_bounded_but_never_empty() -> None:
    outbox = Outbox(ManualClock(), EPOCH)
    for size in (10, 10, 10, 500, 10):
        outbox.append(1, "bulk", 0, bytes(size))
    runs = []
    while (run := outbox.take(1, max_bytes=25, max_samples=100)) is not None:
        assert not isinstance(run, Gap)
        runs.append([sample.seq for sample in run])
    assert runs == [[1, 2], [3], [4], [5]]


def test_bulk_gives_up_the_oldest_and_says_so_once() -> None:
    outbox = make()
    for i in range(25):
        outbox.append(1, "bulk", i, b"x")
    items = take_all(outbox, 1)
    assert isinstance(items[0], Gap)
    assert (items[0].from_seq, items[0].to_seq, items[0].reason) == (1, 15, "outbox_full")
    assert numbers(items) == list(range(1, 26))
    assert outbox.lost == {1: 15}


def test_the_oldest_of_the_class_yields_whichever_stream_it_is_in() -> None:
    outbox = make()
    for _ in range(5):
        outbox.append(1, "bulk", 0, b"x")
    for _ in range(10):
        outbox.append(2, "bulk", 0, b"x")
    assert outbox.lost == {1: 5}
    assert numbers(take_all(outbox, 2)) == list(range(1, 11))


def test_events_keep_the_oldest() -> None:
    outbox = make()
    for i in range(15):
        outbox.append(3, "event", i, b"x")
    items = take_all(outbox, 3)
    assert [item.seq for item in items[:-1] if isinstance(item, Sample)] == list(range(1, 11))
    assert isinstance(items[-1], Gap)
    assert (items[-1].from_seq, items[-1].to_seq) == (11, 15)


def test_too_large_is_a_gap_in_its_place() -> None:
    outbox = make()
    outbox.append(1, "bulk", 0, b"a")
    outbox.give_up(1, "bulk", "too_large")
    outbox.give_up(1, "bulk", "too_large")
    outbox.append(1, "bulk", 0, b"b")
    first, gap, last = take_all(outbox, 1)
    assert isinstance(first, Sample)
    assert gap == Gap(2, 3, "too_large", gap[3], gap[4])
    assert isinstance(last, Sample)


def test_dropping_what_was_sent_needs_no_gap_if_it_is_acknowledged() -> None:
    outbox = make()
    for i in range(10):
        outbox.append(1, "bulk", i, b"x")
    take_all(outbox, 1)
    for i in range(5):
        outbox.append(1, "bulk", i, b"x")
    assert numbers(take_all(outbox, 1)) == [11, 12, 13, 14, 15]
    outbox.acknowledge(1, EPOCH, 12)
    outbox.resume({1: 12})
    assert numbers(take_all(outbox, 1)) == [13, 14, 15]


def test_dropping_what_was_sent_is_declared_when_it_was_lost() -> None:
    outbox = make()
    for i in range(10):
        outbox.append(1, "bulk", i, b"x")
    take_all(outbox, 1)
    for i in range(5):
        outbox.append(1, "bulk", i, b"x")
    outbox.resume({1: 2})
    items = take_all(outbox, 1)
    assert isinstance(items[0], Gap)
    assert (items[0].from_seq, items[0].to_seq) == (3, 5)
    assert numbers(items) == list(range(3, 16))


def test_a_gateway_rolled_back_to_an_older_state_gets_a_gap() -> None:
    outbox = make()
    for i in range(6):
        outbox.append(1, "bulk", i, b"x")
    take_all(outbox, 1)
    outbox.acknowledge(1, EPOCH, 5)
    outbox.resume({1: 2})
    items = take_all(outbox, 1)
    assert isinstance(items[0], Gap)
    assert (items[0].from_seq, items[0].to_seq, items[0].reason) == (3, 5, "acked_and_deleted")
    assert numbers(items) == [3, 4, 5, 6]


def test_impossible_acks_and_watermarks_are_refused_others_ignored() -> None:
    outbox = make()
    outbox.append(1, "bulk", 0, b"x")
    with pytest.raises(FrameError, match="sent was 0"):
        outbox.acknowledge(1, EPOCH, 1)
    with pytest.raises(FrameError, match="accepted 1"):
        outbox.resume({1: 2})
    outbox.acknowledge(1, EPOCH + 1, 5)
    outbox.acknowledge(7, EPOCH, 5)
    assert outbox.sample_count == 1


def test_ranges_for_hello() -> None:
    outbox = make()
    for _ in range(3):
        outbox.append(1, "bulk", 0, b"x")
    take_all(outbox, 1)
    outbox.acknowledge(1, EPOCH, 1)
    assert [tuple(item) for item in outbox.ranges()] == [(1, 2, 3)]


def test_bookkeeping_stays_small_while_one_stream_is_never_acknowledged() -> None:
    outbox = Outbox(ManualClock(), EPOCH)
    outbox.append(1, "bulk", 0, b"x")
    for _ in range(5000):
        seq = outbox.append(2, "bulk", 0, b"x")
        outbox.take(2, max_bytes=100, max_samples=1)
        outbox.acknowledge(2, EPOCH, seq)
    assert len(outbox._arrivals["bulk"]) < 2000


class OutboxMachine(RuleBasedStateMachine):
    """Random appends, sends, acks and reconnects against a gateway that keeps everything it was told."""

    def __init__(self) -> None:
        super().__init__()
        self.outbox = make()
        self.last = dict.fromkeys(STREAMS, 0)
        self.stored: dict[int, dict[int, str]] = {stream: {} for stream in STREAMS}
        self.watermark = dict.fromkeys(STREAMS, 0)
        self.in_flight: list[tuple[int, Sample | Gap]] = []

    @rule(stream=st.sampled_from(list(STREAMS)), count=st.integers(1, 8))
    def append(self, stream: int, count: int) -> None:
        for _ in range(count):
            data = (1, 1.0) if stream == 0 else b"x"
            self.last[stream] = self.outbox.append(stream, STREAMS[stream], 0, data)

    @rule(stream=st.sampled_from([1, 3]))
    def too_large(self, stream: int) -> None:
        self.last[stream] = self.outbox.give_up(stream, STREAMS[stream], "too_large")

    @rule(stream=st.sampled_from(list(STREAMS)), samples=st.integers(1, 5))
    def send(self, stream: int, samples: int) -> None:
        if self.last[stream] == 0:
            return
        run = self.outbox.take(stream, max_bytes=1000, max_samples=samples)
        if run is not None:
            self.in_flight += [(stream, item) for item in ([run] if isinstance(run, Gap) else run)]

    @rule(count=st.integers(1, 10), ack=st.booleans())
    def arrive(self, count: int, ack: bool) -> None:
        for stream, item in self.in_flight[:count]:
            for seq in numbers([item]):
                if seq <= self.watermark[stream]:
                    continue
                assert seq == self.watermark[stream] + 1, "a hole without a gap"
                self.stored[stream][seq] = "row" if isinstance(item, Sample) else "gap"
                self.watermark[stream] = seq
        del self.in_flight[:count]
        if ack:
            for stream, seq in self.watermark.items():
                self.outbox.acknowledge(stream, EPOCH, seq)

    @rule()
    def reconnect(self) -> None:
        self.in_flight.clear()
        self.outbox.resume(self.watermark)

    @invariant()
    def quotas_hold(self) -> None:
        assert self.outbox.size_bytes <= sum(policy.quota_bytes for policy in SMALL.values())

    def teardown(self) -> None:
        self.reconnect()
        for stream in STREAMS:
            if self.last[stream]:
                self.in_flight += [(stream, item) for item in take_all(self.outbox, stream)]
        self.arrive(len(self.in_flight), True)
        for stream, last in self.last.items():
            assert sorted(self.stored[stream]) == list(range(1, last + 1))
        assert (self.outbox.sample_count, self.outbox.size_bytes) == (0, 0)


OutboxMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestOutboxMachine = OutboxMachine.TestCase
