"""Selection: rates hold on average, jitter does not halve them, live needs demand."""

from __future__ import annotations

import math
import random  # noqa: TID251 - seeded by hypothesis

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.select import MetricExtractor, RateLimiter, Selector
from edge_agent.topics import TopicRule


def admitted(limiter: RateLimiter, rate_hz: float, seconds: float, jitter: float = 0.0, seed: int = 1) -> int:
    rng = random.Random(seed)
    count = int(rate_hz * seconds)
    stamps = sorted((i + jitter * (rng.random() - 0.5)) / rate_hz for i in range(count))
    return sum(limiter.admit(stamp) for stamp in stamps)


@given(st.floats(0.1, 100), st.floats(0.1, 1000))
def test_never_more_than_the_limit(limit_hz: float, source_hz: float) -> None:
    assert admitted(RateLimiter(limit_hz), source_hz, 20.0) <= limit_hz * 20.0 + 2


@given(st.integers(0, 1000), st.floats(1, 100))
def test_a_source_at_the_limit_passes_despite_jitter(seed: int, rate_hz: float) -> None:
    assert admitted(RateLimiter(rate_hz), rate_hz, 20.0, jitter=0.4, seed=seed) >= rate_hz * 20.0 * 0.95 - 1


@pytest.mark.parametrize(
    ("source_hz", "limit_hz", "expected"), [(20, 10, 100), (50, 20, 200), (10, 2, 20), (1, 10, 10)]
)
def test_thinning_is_even(source_hz: float, limit_hz: float, expected: int) -> None:
    assert admitted(RateLimiter(limit_hz), source_hz, 10.0) == pytest.approx(expected, abs=2)


def test_zero_means_no_limit() -> None:
    limiter = RateLimiter(0)
    assert all(limiter.admit(1.0) for _ in range(100))


def test_a_pause_gives_no_burst() -> None:
    limiter = RateLimiter(10)
    limiter.admit(0.0)
    assert [limiter.admit(100.0 + i / 1000) for i in range(5)] == [True, False, False, False, False]


def test_live_goes_only_on_demand_and_at_its_rate() -> None:
    selector = Selector(TopicRule(match="**"), "live", max_rate_hz=10)
    assert not selector.admit(0.0)
    selector.demand(5)
    assert sum(selector.admit(i / 100) for i in range(1000)) == pytest.approx(50, abs=1)
    selector.demand(None)
    assert not selector.admit(100.0)
    assert selector.demand_hz is None


@pytest.mark.parametrize(("asked", "granted"), [(0, 10), (5, 5), (50, 10), (-1, 10), (math.nan, 10), (math.inf, 10)])
def test_demand_never_exceeds_the_table(asked: float, granted: float) -> None:
    selector = Selector(TopicRule(match="**"), "live", max_rate_hz=10)
    selector.demand(asked)
    assert selector.demand_hz == granted


def test_the_same_demand_again_keeps_the_rhythm() -> None:
    selector = Selector(TopicRule(match="**"), "live", max_rate_hz=0)
    count = 0
    for i in range(1000):
        selector.demand(2)
        count += selector.admit(i / 100)
    assert count == pytest.approx(20, abs=1)


def test_bulk_and_event_need_no_demand() -> None:
    assert Selector(TopicRule(match="**"), "bulk", max_rate_hz=0).admit(0.0)
    assert Selector(TopicRule(match="**"), "event", max_rate_hz=0).admit(0.0)


def test_what_is_not_forwarded_never_leaves() -> None:
    selector = Selector(TopicRule(match="**", forward=False), "live", max_rate_hz=0)
    selector.demand(0)
    assert not selector.admit(0.0)


def test_metric_rows_skip_what_is_not_there() -> None:
    extractor = MetricExtractor((4, 5), lambda payload: (float(len(payload)), math.nan), rate_hz=2)
    assert extractor.rows(b"abc") == [(4, 3.0)]
    assert [extractor.due(t) for t in (0.0, 0.1, 0.5, 1.0)] == [True, False, True, True]
