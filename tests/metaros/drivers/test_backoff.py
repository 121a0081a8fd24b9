"""How soon a device is tried again."""

from __future__ import annotations

from metaros.drivers.back_off import BackOff


def test_it_is_back_within_two_seconds_however_long_it_was_away() -> None:
    back_off = BackOff()
    waits = [back_off.next_s() for _ in range(10_000)]
    assert waits[:3] == [0.25, 0.5, 0.5]
    assert max(waits) <= 1.0


def test_a_device_that_worked_is_tried_soon() -> None:
    back_off = BackOff()
    for _ in range(5):
        back_off.next_s()
    back_off.worked()
    assert back_off.next_s() == 0.25
