"""The rate of arrivals, pure."""

from __future__ import annotations

import pytest

from metaros.cli.graph_target.listener import Rate


def fed(count: int, gap_s: float, size: int = 100, window: int = 1000) -> Rate:
    """A rate that saw `count` messages every `gap_s`."""
    rate = Rate(window)
    for number in range(count):
        rate.add(number * gap_s, bytes(size))
    return rate


def test_a_steady_rate() -> None:
    report = fed(101, 0.1).report(10.0)
    assert report["rate_hz"] == pytest.approx(10.0)
    assert report["min_s"] == pytest.approx(0.1)
    assert report["max_s"] == pytest.approx(0.1)
    assert report["std_s"] == pytest.approx(0.0, abs=1e-9)
    assert report["window"] == 101


def test_bandwidth_counts_the_time_that_passed() -> None:
    report = fed(11, 0.1, size=1000).report(1.1)
    assert report["bytes_per_s"] == pytest.approx(10_000.0)
    assert report["mean_bytes"] == 1000


def test_nothing_and_one_message_say_nothing() -> None:
    assert Rate(10).report(1.0) == {"window": 0}
    assert fed(1, 1.0).report(1.0) == {"window": 1}


def test_silence_begins_a_new_measurement() -> None:
    rate = fed(50, 0.1)
    assert rate.report(60.0) == {"window": 0}
    assert rate.report(60.0) == {"window": 0}


def test_a_slow_topic_is_not_silent() -> None:
    assert fed(3, 5.0).report(14.0)["rate_hz"] == pytest.approx(0.2)


def test_the_window_forgets() -> None:
    assert fed(100, 0.1, window=10).report(9.9)["window"] == 10


def test_a_topic_slower_than_the_reports_has_a_rate() -> None:
    rate, now = Rate(100), 0.0
    windows = []
    for second in range(1, 16):
        if second % 5 == 0:
            rate.add(second - 0.5, b"12345678")
        windows.append(rate.report(now := float(second))["window"])
    assert windows == [0] * 4 + [1] * 5 + [2] * 5 + [3]
    assert rate.report(now)["rate_hz"] == 0.2


def test_one_message_does_not_wait_for_ever() -> None:
    rate = Rate(100)
    rate.add(0.0, b"1")
    assert rate.report(61.0)["window"] == 0
    rate.add(62.0, b"1")
    rate.add(62.1, b"1")
    assert rate.report(63.0)["rate_hz"] == pytest.approx(10)
