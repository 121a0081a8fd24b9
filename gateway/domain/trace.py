"""The times of one traced sample on its robot, as it reported them, put on the gateway's clock."""

from __future__ import annotations

import re
from dataclasses import dataclass

from metaros._proto import link_pb2

__all__ = ["RobotTimes", "read_trace"]

_TRACEPARENT = re.compile(r"00-([0-9a-f]{32})-([0-9a-f]{16})-[0-9a-f]{2}")
_MOST_NS = 2**62  # what may be added up without an overflow anywhere
_ZERO = "0" * 32


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotTimes:
    """Wall-clock nanoseconds of the robot; `accepted_ns` is 0 for what is not kept on its disk."""

    trace_id: str
    span_id: str
    seq: int
    tapped_ns: int
    taken_ns: int
    accepted_ns: int
    sent_ns: int
    clock_offset_ns: int  # the gateway's clock less the robot's


def read_trace(batch: link_pb2.Batch) -> RobotTimes | None:
    """The trace of a batch; None where it has none, or one that cannot be read: a link never ends for it."""
    if not batch.HasField("trace"):
        return None
    trace = batch.trace
    found = _TRACEPARENT.fullmatch(trace.traceparent)
    if found is None or _ZERO.startswith((found[1], found[2])):
        return None
    times = (trace.tapped_ns, trace.taken_ns, trace.accepted_ns, trace.sent_ns)
    if not batch.first_seq <= trace.seq < batch.first_seq + batch.count or not all(0 <= at < _MOST_NS for at in times):
        return None
    if abs(trace.clock_offset_ns) >= _MOST_NS:
        return None
    return RobotTimes(
        trace_id=found[1],
        span_id=found[2],
        seq=trace.seq,
        tapped_ns=trace.tapped_ns,
        taken_ns=trace.taken_ns,
        accepted_ns=trace.accepted_ns,
        sent_ns=trace.sent_ns,
        clock_offset_ns=trace.clock_offset_ns,
    )
