"""A traced sample from its stamp to viewers and database row, as adjacent spans that add up. Pure.

    bus      the node stamped it             -> the agent's tap saw it
    tap      the tap saw it                  -> it was chosen, and began to wait
    outbox   it began to wait                -> it was on the robot's disk (not of the live class)
    uplink   it was on disk, or in memory    -> it was put into a frame
    link     it was put into a frame         -> the gateway had read the frame
    ingest   the gateway had read the frame  -> it was given to viewers and to the store
    fanout   it was given to viewers         -> it was written to the last of them
    store    it was given to the store       -> its row was committed

The robot's times are put on the gateway's clock. Where a clock is wrong by so much that something would have happened
before its cause, or before 1970, it counts as having happened together with it, or then, and the trace says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from gateway.domain.trace import RobotTimes

__all__ = ["BRANCHES", "STAGES", "Span", "TracedSample"]

STAGES = ("bus", "tap", "outbox", "uplink", "link", "ingest")  # one after the other
BRANCHES = ("fanout", "store")  # both begin at the end of the last


@dataclass(frozen=True, slots=True)
class Span:
    """A stage, in nanoseconds of the gateway's wall clock."""

    name: str
    start_ns: int
    end_ns: int

    @property
    def duration_ns(self) -> int:
        """How long it took; never negative."""
        return self.end_ns - self.start_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class TracedSample:
    """What is known of one traced sample; 0 = not happened, or not yet."""

    robot: str
    topic: str
    delivery: str
    size_bytes: int  # of its batch
    samples: int  # in its batch
    times: RobotTimes
    stamp_ns: int
    received_ns: int
    given_ns: int
    written_ns: int = 0
    committed_ns: int = 0

    def written(self, at_ns: int) -> TracedSample:
        """The traced sample once viewers have the sample."""
        return replace(self, written_ns=at_ns)

    def committed(self, at_ns: int) -> TracedSample:
        """The traced sample once its row is stored."""
        return replace(self, committed_ns=at_ns)

    def points(self) -> tuple[list[tuple[str, int]], bool]:
        """The start, then each stage's end, on the gateway's clock and in order; whether a clock had to yield."""
        times, offset = self.times, self.times.clock_offset_ns
        robot = [("stamp", self.stamp_ns), ("bus", times.tapped_ns), ("tap", times.taken_ns)]
        if times.accepted_ns:
            robot.append(("outbox", times.accepted_ns))
        robot.append(("uplink", times.sent_ns))
        ahead = max(0, times.sent_ns + offset - self.received_ns)  # a frame does not arrive before it is sent
        points = [(name, at_ns + offset - ahead) for name, at_ns in robot]
        points += [("link", self.received_ns), ("ingest", max(self.given_ns, self.received_ns))]
        adjusted, before_ns = ahead > 0, points[-1][1]
        for index in range(len(points) - 1, -1, -1):
            name, at_ns = points[index]
            before_ns = max(0, min(at_ns, before_ns))
            adjusted |= at_ns != before_ns
            points[index] = (name, before_ns)
        return points, adjusted

    def spans(self) -> list[Span]:
        """The stages in order, then the branches that have ended."""
        points, _ = self.points()
        spans = [Span(name, points[index][1], at_ns) for index, (name, at_ns) in enumerate(points[1:])]
        end_ns = points[-1][1]
        for name, at_ns in (("fanout", self.written_ns), ("store", self.committed_ns)):
            if at_ns:
                spans.append(Span(name, end_ns, max(at_ns, end_ns)))
        return spans

    def document(self) -> dict[str, Any]:
        """As the API shows it."""
        points, adjusted = self.points()
        spans, start_ns = self.spans(), points[0][1]
        return {
            "trace_id": self.times.trace_id,
            "robot": self.robot,
            "topic": self.topic,
            "class": self.delivery,
            "seq": self.times.seq,
            "batch_samples": self.samples,
            "batch_bytes": self.size_bytes,
            "start_ns": start_ns,
            "total_ns": max(span.end_ns for span in spans) - start_ns,
            "clock_offset_ns": self.times.clock_offset_ns,
            "clock_adjusted": adjusted,
            "spans": [{"name": span.name, "start_ns": span.start_ns, "end_ns": span.end_ns} for span in spans],
        }
