"""How soon a device is tried again."""

from __future__ import annotations

from metaros.drivers.backoff import Backoff


def test_it_is_back_within_two_seconds_however_long_it_was_away() -> None:
    backoff = Backoff()
    waits = [backoff.next_s() for _ in range(10_000)]
    assert waits[:3] == [0.25, 0.5, 0.5]
    assert max(waits) <= 1.0


def test_a_device_that_worked_is_tried_soon() -> None:
    backoff = Backoff()
    for _ in range(5):
        backoff.next_s()
    backoff.reset()
    assert backoff.next_s() == 0.25
