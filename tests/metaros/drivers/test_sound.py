"""The pace of devices that have none, and devices that hang."""

from __future__ import annotations

import pytest

from metaros.clock import ManualClock
from metaros.drivers.sound import PACKET_S, Pacer


def test_a_device_that_never_blocks_is_kept_at_its_rate() -> None:
    clock = ManualClock()
    pacer = Pacer(clock)
    began_s = clock.monotonic_s()
    for _ in range(500):
        clock.advance(pacer.ahead_s(blocked=False))
    assert clock.monotonic_s() - began_s == pytest.approx(500 * PACKET_S, abs=0.1)
    clock.advance(60.0)  # the machine slept: nothing is made up for
    assert sum(pacer.ahead_s(blocked=False) == 0 for _ in range(100)) <= 4


def test_a_device_that_blocks_is_never_waited_for() -> None:
    clock = ManualClock()
    pacer = Pacer(clock)
    for _ in range(100_000):  # its clock is faster than ours, by a thousandth
        clock.advance(PACKET_S * 0.999)
        assert pacer.ahead_s(blocked=True) == 0
