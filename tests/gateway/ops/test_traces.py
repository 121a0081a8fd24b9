"""Which samples are followed, when their journeys end, and who sees them."""

from __future__ import annotations

import numpy as np

from gateway.domain.channel import Channel
from gateway.domain.sample import Run
from gateway.domain.trace import RobotTimes
from gateway.ops.sample_trace import TracedSample
from gateway.ops.traces import Traces
from metaros.clock import ManualClock
from metaros.limits import Limits
from metaros.link import SampleColumns


class Rig:
    """A recorder, its clock, and what has ended."""

    def __init__(self, limits: Limits | None = None) -> None:
        self.clock = ManualClock()
        self.ended: list[TracedSample] = []
        self.traces = Traces(self.clock, on_ended=self.ended.append, limits=limits or Limits())
        self.made = 0

    def run(self, *, robot: str = "r1", topic: str = "/odom", delivery: str = "bulk", seq: int = 11) -> Run:
        """Three samples from number 10 on, of which one is followed; received now."""
        self.made += 1
        wall_ns = self.clock.wall_ns()
        columns = SampleColumns(
            stream_id=1,
            epoch=1,
            first_seq=10,
            stamps_ns=np.asarray([wall_ns - 3000, wall_ns - 2000, wall_ns - 1000], np.int64),
            offsets=np.asarray([0, 1, 2, 3], np.int64),
            payload=b"abc",
        )
        times = RobotTimes(
            trace_id=f"{self.made:032x}",
            span_id="cd" * 8,
            seq=seq,
            tapped_ns=wall_ns - 1900,
            taken_ns=wall_ns - 1800,
            accepted_ns=0,
            sent_ns=wall_ns - 500,
            clock_offset_ns=0,
        )
        channel = Channel(
            robot=robot,
            channel_id=1,
            topic=topic,
            schema_name="std_msgs/msg/String",
            type_hash="",
            delivery=delivery,
        )
        return Run(channel, columns, wall_ns, times)

    def later(self, seconds: float) -> None:
        """Time passes, and the recorder looks."""
        self.clock.advance(seconds)
        self.traces.tick()


def test_a_journey_ends_with_its_row_and_its_viewers() -> None:
    rig = Rig()
    run = rig.run()
    rig.traces.arrived(run)
    rig.clock.advance(0.002)
    rig.traces.written(run)
    rig.later(0.1)
    assert rig.ended == [], "its row is not stored yet"
    rig.traces.committed([run])
    rig.later(0.1)
    (traced,) = rig.ended
    assert (traced.robot, traced.topic, traced.samples) == ("r1", "/odom", 3)
    assert traced.stamp_ns == int(run.columns.stamps_ns[1])
    took = {span.name: span.duration_ns for span in traced.spans()}
    assert took == {
        "bus": 100,
        "tap": 100,
        "uplink": 1300,
        "link": 500,
        "ingest": 0,
        "fanout": 2_000_000,
        "store": 102_000_000,
    }


def test_without_viewers_or_a_row_it_ends_by_itself() -> None:
    rig = Rig()
    rig.traces.arrived(rig.run(delivery="live"))
    rig.later(0.5)
    assert rig.ended == [], "a viewer may yet get it"
    rig.later(0.6)
    assert [span.name for span in rig.ended[0].spans()][-1] == "ingest"
    rig.traces.arrived(rig.run())
    rig.later(29)
    assert len(rig.ended) == 1
    rig.later(2)
    assert len(rig.ended) == 2


def test_a_copy_for_the_history_alone_is_first_received_of_when_it_is_stored() -> None:
    rig = Rig()
    run = rig.run()
    rig.clock.advance(0.05)
    rig.traces.committed([run])
    rig.later(1.1)
    (traced,) = rig.ended
    assert {span.name: span.duration_ns for span in traced.spans()}["store"] == 50_000_000


def test_what_is_not_marked_or_not_there_is_not_followed() -> None:
    rig = Rig()
    marked = rig.run()
    rig.traces.arrived(Run(marked.channel, marked.columns, marked.receive_ns))
    rig.traces.arrived(rig.run(seq=9))
    rig.traces.written(rig.run())
    rig.later(60)
    assert (rig.ended, rig.traces.followed) == ([], 0)


def test_more_than_the_bounds_are_only_counted() -> None:
    rig = Rig(Limits(traces_kept=8, traces_per_s=5))
    for _ in range(7):
        rig.traces.arrived(rig.run(delivery="live"))
    assert (rig.traces.followed, rig.traces.skipped) == (5, 2)
    rig.clock.advance(1)
    for _ in range(5):
        rig.traces.arrived(rig.run(delivery="live"))
    assert (rig.traces.followed, rig.traces.skipped) == (8, 4), "so many are under way"
    rig.later(2)
    assert len(rig.ended) == 8
    rig.traces.arrived(rig.run(delivery="live", topic="/newest"))
    rig.later(2)
    found = rig.traces.newest(sees=lambda robot: True, limit=100)
    assert len(found) == 8
    assert found[0].topic == "/newest"


def test_the_newest_first_of_what_is_asked_for_and_may_be_seen() -> None:
    rig = Rig()
    for robot, topic in (("r1", "/a"), ("r2", "/a"), ("r1", "/b"), ("r1", "/a")):
        rig.traces.arrived(rig.run(robot=robot, topic=topic, delivery="live"))
        rig.later(2)

    def names(**asked: str) -> list[str]:
        found = rig.traces.newest(sees=lambda robot: robot != "r2", limit=2, **asked)
        return [f"{traced.robot} {traced.topic} {int(traced.times.trace_id, 16)}" for traced in found]

    assert names() == ["r1 /a 4", "r1 /b 3"]
    assert names(topic="/a") == ["r1 /a 4", "r1 /a 1"]
    assert names(robot="r2") == []
