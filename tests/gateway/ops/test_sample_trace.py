"""Spans of a followed sample: they touch and add up, whatever the clocks say."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from gateway.domain.trace import RobotTimes
from gateway.ops.sample_trace import BRANCHES, STAGES, TracedSample

MS = 10**6
START_NS = 1_700_000_000 * 10**9
MOMENTS = st.integers(0, 2**61)
STAMPS = st.one_of(MOMENTS, st.integers(-(2**63), 2**63 - 1))  # a node stamps as it likes


def times(**changed: int) -> RobotTimes:
    """On the robot's clock, which is 5 ms behind the gateway's."""
    told = {"tapped_ns": START_NS + MS, "taken_ns": START_NS + 2 * MS, "accepted_ns": START_NS + 4 * MS}
    told |= {"sent_ns": START_NS + 7 * MS, "clock_offset_ns": 5 * MS, "seq": 3}
    return RobotTimes(trace_id="ab" * 16, span_id="cd" * 8, **{**told, **changed})


def traced(told: RobotTimes, **changed: int) -> TracedSample:
    """Received 11 ms after its stamp, given on 1 ms later, written 2 ms and stored 8 ms after that."""
    at_ns = START_NS + 5 * MS
    moments = {"stamp_ns": START_NS, "received_ns": at_ns + 11 * MS, "given_ns": at_ns + 12 * MS}
    moments |= {"written_ns": at_ns + 14 * MS, "committed_ns": at_ns + 20 * MS}
    return TracedSample(
        robot="r", topic="/t", delivery="bulk", size_bytes=5, samples=1, times=told, **{**moments, **changed}
    )


def test_each_stage_has_its_time_on_the_gateways_clock() -> None:
    found = traced(times())
    took = {span.name: span.duration_ns // MS for span in found.spans()}
    assert took == {
        "bus": 1,
        "tap": 1,
        "outbox": 2,
        "uplink": 3,
        "link": 4,
        "ingest": 1,
        "fanout": 2,
        "store": 8,
    }
    document = found.document()
    assert document["start_ns"] == START_NS + 5 * MS
    assert document["total_ns"] == 20 * MS
    assert document["clock_adjusted"] is False


def test_a_live_sample_has_no_outbox_and_one_without_viewers_no_fanout() -> None:
    names = [span.name for span in traced(times(accepted_ns=0), written_ns=0, committed_ns=0).spans()]
    assert names == ["bus", "tap", "uplink", "link", "ingest"]


def test_a_frame_never_arrives_before_it_is_sent() -> None:
    document = traced(times(clock_offset_ns=500 * MS)).document()
    assert document["clock_adjusted"] is True
    spans = {span["name"]: span for span in document["spans"]}
    assert spans["link"]["start_ns"] == spans["link"]["end_ns"]
    assert spans["uplink"]["end_ns"] - spans["uplink"]["start_ns"] == 3 * MS, "the robot's own times stay as they were"


def test_a_stamp_from_before_1970_counts_as_of_then() -> None:
    for stamp_ns in (-(2**63), -10 * MS):
        found = traced(times(), stamp_ns=stamp_ns)
        assert (found.spans()[0].name, found.spans()[0].start_ns) == ("bus", 0)
        assert found.document()["clock_adjusted"] is True


@given(st.tuples(STAMPS, *[MOMENTS] * 8), st.integers(-(2**61), 2**61))
def test_whatever_the_clocks_say_the_stages_touch_and_add_up(moments: tuple[int, ...], offset_ns: int) -> None:
    stamp, tapped, taken, accepted, sent, received, given_ns, written, committed = moments
    told = times(tapped_ns=tapped, taken_ns=taken, accepted_ns=accepted, sent_ns=sent, clock_offset_ns=offset_ns)
    changed = {"stamp_ns": stamp, "received_ns": received, "given_ns": given_ns}
    found = traced(told, **changed, written_ns=written, committed_ns=committed)
    chain = [span for span in found.spans() if span.name in STAGES]
    assert all(0 <= span.start_ns <= span.end_ns < 2**63 for span in found.spans())  # else no exporter takes it
    assert all(one.end_ns == other.start_ns for one, other in pairwise(chain))
    assert all(span.start_ns == chain[-1].end_ns for span in found.spans() if span.name in BRANCHES)
    document = found.document()
    whole = sum(span.duration_ns for span in chain) + max(
        (span.duration_ns for span in found.spans() if span.name in BRANCHES), default=0
    )
    assert document["total_ns"] == whole
