"""The windows that health rules read, by hand-made times."""

from __future__ import annotations

import pytest

from metaros.node.lifecycle.meters import GapMeter, RateMeter, WindowMax


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 5.0, 10.0, 1000.0])
def test_a_steady_rate_is_read_as_it_is(rate_hz: float) -> None:
    meter = RateMeter(2.0)
    for number in range(round(rate_hz * 10)):
        meter.tick(number / rate_hz)
    assert meter.rate_hz(10.0 - 1e-6) == pytest.approx(rate_hz, rel=1e-6)
    assert meter.rate_hz(10.0 - 0.5 / rate_hz) == pytest.approx(rate_hz, rel=1e-6)
    assert len(meter._buckets) <= 12


def test_a_silence_empties_the_window() -> None:
    meter = RateMeter(1.0)
    meter.tick(5.0)
    assert meter.count(5.5) == 1
    assert meter.count(6.11) == 0
    assert meter.rate_hz(1e6) == 0


def test_a_rate_that_falls_is_seen_before_the_next_event() -> None:
    meter = RateMeter(2.0)
    for number in range(21):
        meter.tick(number * 0.1)
    assert meter.rate_hz(2.0) == pytest.approx(10.0)
    assert 5.0 < meter.rate_hz(3.0) < 8.0
    assert meter.rate_hz(3.9) < 2.0
    assert meter.rate_hz(4.3) == 0.0


def test_the_greatest_of_a_window() -> None:
    meter = WindowMax(1.0)
    assert meter.greatest(0.0) == 0
    meter.put(0.0, 0.5)
    meter.put(0.05, 0.2)
    meter.put(0.9, 0.1)
    assert meter.greatest(1.0) == 0.5
    assert meter.greatest(1.5) == 0.1


def test_missed_deadlines_are_counted_while_the_silence_lasts() -> None:
    meter = GapMeter(0.1, 2.0, now_s=0.0)
    for tenth in range(1, 20):
        meter.tick(tenth * 0.09)
        assert meter.missed(tenth * 0.09) == 0
    assert meter.missed(1.71 + 0.35) == 3
    meter.tick(2.07)
    assert meter.missed(2.1) == 3
    assert meter.missed(2.2) == 4
    meter.tick(2.2)
    for tenth in range(1, 40):
        meter.tick(2.2 + tenth * 0.09)
    assert meter.missed(5.75) == 0
