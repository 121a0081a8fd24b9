"""A value that froze, beside one that rests."""

from __future__ import annotations

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.flat import Flat
from tests.gateway.alerting.anomaly.cellfeed import second


@pytest.fixture
def flat() -> Flat:
    made = Flat(changes=100)
    made.columns.grow(1)
    return made


def feed(flat: Flat, values: list[float], *, start_s: float, count: int = 10) -> list[tuple[int, bool]]:
    found = []
    for n, value in enumerate(values):
        verdict = flat.feed(second(start_s + n, [value], count=count))
        found += [(n, bool(opened)) for opened in verdict.opened]
    return found


def noise(count: int) -> list[float]:
    return np.random.default_rng(5).normal(size=count).tolist()


def test_a_noisy_series_that_stops_is_frozen_within_five_seconds_and_moves_again(flat: Flat) -> None:
    feed(flat, noise(200), start_s=1e9)
    assert feed(flat, [0.3] * 8 + [0.4, 0.5], start_s=1e9 + 200.0) == [(4, True), (8, False)]


def test_a_series_may_rest_where_it_often_rests_but_not_remote(flat: Flat) -> None:
    start_s = 1e9
    for _ in range(30):
        feed(flat, [*noise(10), *[0.0] * 60], start_s=start_s)
        start_s += 70.0
    assert feed(flat, [*noise(3), *[0.0] * 100], start_s=start_s) == []
    assert feed(flat, [*noise(3), *[0.7] * 20], start_s=start_s + 103.0) == [(7, True)]


def test_a_constant_series_and_one_of_few_rows_are_never_frozen(flat: Flat) -> None:
    assert feed(flat, [1.0] * 500, start_s=1e9) == []
    slow = Flat(changes=100)
    slow.columns.grow(1)
    feed(slow, noise(200), start_s=1e9, count=1)
    assert feed(slow, [0.3] * 15, start_s=1e9 + 200.0, count=1) == []


def test_years_between_two_equal_values_are_no_run(flat: Flat) -> None:
    feed(flat, [*noise(200), 0.3], start_s=1e9)
    assert feed(flat, [0.3, 0.3], start_s=1.3e9) == []
    assert feed(flat, [0.3, 0.3], start_s=5.0) == []


def test_what_was_accepted_may_last(flat: Flat) -> None:
    feed(flat, noise(200), start_s=1e9)
    assert feed(flat, [0.3] * 30, start_s=1e9 + 200.0) == [(4, True)]
    flat.accept(0)
    assert feed(flat, [0.4, *[0.3] * 40], start_s=1e9 + 230.0) == [(0, False)]
