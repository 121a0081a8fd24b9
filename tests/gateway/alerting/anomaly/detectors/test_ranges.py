"""What lies lastingly outside of a learnt range."""

from __future__ import annotations

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.ranges import RangeRule, Ranges

RULE = RangeRule(part=0.3, deviations=0.5, need=3, clear=4, learn=200, epoch=100, adopt=500, memory=100_000)


@pytest.fixture
def ranges() -> Ranges:
    made = Ranges(RULE)
    made.columns.grow(1)
    feed(made, np.random.default_rng(2).uniform(-1.0, 1.0, 400).tolist())
    return made


def feed(ranges: Ranges, values: list[float]) -> list[tuple[int, str]]:
    found = []
    for n, value in enumerate(values):
        verdict = ranges.evaluate(np.array([0]), np.array([value]))
        if verdict.opened[0] or verdict.closed[0]:
            found.append((n, "opened" if verdict.opened[0] else "closed"))
    return found


def test_what_lasts_opens_and_closes_when_it_is_back(ranges: Ranges) -> None:
    assert feed(ranges, [5.0] * 10 + [0.0] * 10) == [(2, "opened"), (13, "closed")]


def test_a_spike_and_the_margin_say_nothing(ranges: Ranges) -> None:
    assert feed(ranges, [500.0, 500.0, 0.0, 1.2, 1.2, 1.2, 1.2]) == []
    _low, high = ranges.band(np.array([0]))
    assert high[0] < 4.0


def test_a_slow_drift_is_held_against_how_things_were(ranges: Ranges) -> None:
    assert [word for _, word in feed(ranges, [1.0 + 0.02 * n for n in range(100)])] == ["opened"]


def test_what_lasts_very_long_is_the_new_normal(ranges: Ranges) -> None:
    assert feed(ranges, [5.0] * 1200) == [(2, "opened"), (499, "closed")]


def test_nothing_is_reported_while_it_learns_and_an_accepted_value_is_normal(ranges: Ranges) -> None:
    fresh = Ranges(RULE)
    fresh.columns.grow(1)
    assert feed(fresh, [0.0] * 100 + [9.0] * 99) == []
    ranges.accept(0, 5.0)
    assert feed(ranges, [5.0] * 10) == []
