"""A trace that a robot tells is believed where it can be, and never ends a link."""

from __future__ import annotations

from gateway.domain.trace import read_trace
from metaros._proto import link_pb2

GOOD = f"00-{'ab' * 16}-{'cd' * 8}-01"


def batch(**reported: object) -> link_pb2.Batch:
    """A batch of the numbers 5 to 7 with a trace."""
    trace = link_pb2.SampleTrace(**{"seq": 6, "traceparent": GOOD, "sent_ns": 9, **reported})  # type: ignore[arg-type]
    return link_pb2.Batch(stream_id=1, first_seq=5, count=3, trace=trace)


def test_a_trace_is_read() -> None:
    found = read_trace(batch(tapped_ns=1, taken_ns=2, accepted_ns=3, clock_offset_ns=-4))
    assert found is not None
    assert (found.trace_id, found.span_id, found.seq) == ("ab" * 16, "cd" * 8, 6)
    assert (found.tapped_ns, found.taken_ns, found.accepted_ns, found.sent_ns) == (1, 2, 3, 9)
    assert found.clock_offset_ns == -4
    assert read_trace(link_pb2.Batch(first_seq=5, count=3)) is None


NO_TRACES: tuple[dict[str, object], ...] = (
    {"traceparent": ""},
    {"traceparent": GOOD.upper()},
    {"traceparent": GOOD + "\n"},
    {"traceparent": f"01-{'ab' * 16}-{'cd' * 8}-01"},
    {"traceparent": f"00-{'0' * 32}-{'cd' * 8}-01"},
    {"traceparent": f"00-{'ab' * 16}-{'0' * 16}-01"},
    {"seq": 4},
    {"seq": 8},
    {"sent_ns": -1},
    {"tapped_ns": 2**62},
    {"clock_offset_ns": -(2**62)},
)


def test_what_cannot_be_so_is_no_trace() -> None:
    assert [reported for reported in NO_TRACES if read_trace(batch(**reported)) is not None] == []
