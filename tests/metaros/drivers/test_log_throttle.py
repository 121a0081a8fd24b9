"""A log that a device which stays away cannot fill."""

from __future__ import annotations

from metaros.clock import ManualClock
from metaros.drivers.log_throttle import MAX_TEXTS, LogThrottle


def test_hours_of_the_same_are_a_line_a_minute() -> None:
    clock = ManualClock()
    repeats = LogThrottle(clock)
    said = 0
    for _ in range(7200):
        said += repeats.should_log("away")
        clock.advance(1.0)
    assert 100 <= said <= 120


def test_texts_that_always_differ_are_bounded_too() -> None:
    repeats = LogThrottle(ManualClock())
    assert sum(repeats.should_log(f"away {number}") for number in range(1000)) == MAX_TEXTS
