"""Too slow and too fast, against the rate that was learnt and the table of checks."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from gateway.alerting.anomaly.checks import CheckTable
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.detectors.rates import Rates

ROW = np.array([0])


@pytest.fixture(scope="module")
def ten_minutes() -> Rates:
    """It has seen ten minutes of ten a second."""
    rates = Rates()
    rates.columns.grow(1)
    rates.low.columns.grow(1)
    rates.high.columns.grow(1)
    for n in range(600):
        rates.feed(ROW, np.array([10.0]), float(n))
    return rates


@pytest.fixture
def rates(ten_minutes: Rates) -> Rates:
    return deepcopy(ten_minutes)


def edges(rates: Rates, hz: float, seconds: int, *, start_s: float = 600.0) -> list[tuple[float, str, bool]]:
    """What opened and closed while it came so often: (second, which, opened)."""
    found = []
    for n in range(seconds):
        for word, verdict in zip(("low", "high"), rates.feed(ROW, np.array([hz]), start_s + n), strict=True):
            found += [(n, word, bool(opened)) for opened in verdict.opened]
    return found


def table(**changes: float | None) -> CheckTable:
    return CheckTable(replace(check, **changes) if check.id == "rate_low" else check for check in DEFAULT_CHECKS)


def test_half_the_usual_rate_is_too_slow_and_over_when_it_is_back(rates: Rates) -> None:
    assert [word for _, word, opened in edges(rates, 3.0, 20) if opened] == ["low"]
    assert [word for _, word, opened in edges(rates, 10.0, 30, start_s=620.0) if not opened] == ["low"]


def test_twice_the_usual_rate_is_too_fast(rates: Rates) -> None:
    assert [word for _, word, _ in edges(rates, 30.0, 20)] == ["high"]


@pytest.mark.parametrize(("changes", "seconds"), [({"low": 0.2}, 20), ({"for_s": 60.0}, 40), ({"low": None}, 40)])
def test_the_table_of_checks_says_what_is_too_slow_and_for_how_long(
    rates: Rates, changes: dict[str, float | None], seconds: int
) -> None:
    rates.set_checks(table(**changes))
    assert edges(rates, 3.0, seconds) == []
