"""A gateway that did not listen holds nobody for dead."""

from __future__ import annotations

from gateway.ingest.events import Closed
from gateway.ingest.session import Session
from gateway.ingest.stall_detector import StallDetector
from gateway.ingest.streams import StreamTable
from metaros.clock import ManualClock
from tests.gateway.ingest.test_session import hello


def test_looks_without_a_pause_count_from_the_first_one() -> None:
    detector = StallDetector()
    assert [detector.tick(second / 4) for second in range(40, 60)] == [10.0] * 20
    assert detector.tick(20.0) == 20.0
    assert detector.tick(20.9) == 20.0


def test_silence_is_counted_from_when_the_gateway_listened() -> None:
    clock, detector = ManualClock(), StallDetector()
    session = Session(hello(), StreamTable(), gateway_id="g", store_id="s")
    session.open_lane(hello(), now_s=clock.monotonic_s(), wall_ns=0)

    def ended() -> str | None:
        since_s = detector.tick(clock.monotonic_s())
        events = session.tick(now_s=clock.monotonic_s(), wall_ns=0, since_s=since_s)
        return next((event.code for event in events if isinstance(event, Closed)), None)

    assert ended() is None
    clock.advance(40.0)  # it stood still
    assert ended() is None
    for _ in range(14):
        clock.advance(1.0)
        assert ended() is None
    clock.advance(1.0)
    assert ended() == "dead"
