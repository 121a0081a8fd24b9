"""Selection: rates hold on average, jitter does not halve them, live needs demand."""

from __future__ import annotations

import math
import random  # noqa: TID251 - seeded by hypothesis
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.config.topic_table import TopicRule
from edge_agent.forwarding.filters import Deadband, MetricExtractor, RateLimiter, SampleDeadband, Selector
from metaros.errors import DecodeError


def admitted(limiter: RateLimiter, rate_hz: float, seconds: float, jitter: float = 0.0, seed: int = 1) -> int:
    rng = random.Random(seed)
    count = int(rate_hz * seconds)
    stamps = sorted((i + jitter * (rng.random() - 0.5)) / rate_hz for i in range(count))
    return sum(limiter.admit(stamp) for stamp in stamps)


@given(st.floats(0.1, 100), st.floats(0.1, 1000))
def test_never_more_than_the_limit(limit_hz: float, source_hz: float) -> None:
    assert admitted(RateLimiter(limit_hz), source_hz, 5.0) <= limit_hz * 5.0 + 2


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
    assert extractor.rows(b"abc", 0.0) == [(4, 3.0)]
    assert [extractor.due(t) for t in (0.0, 0.1, 0.5, 1.0)] == [True, False, True, True]


def test_a_dead_band_lets_moves_pass_and_silence_end() -> None:
    band = Deadband(0.5, max_s=10.0)
    steps = [(0.0, 1.0), (1.0, 1.4), (2.0, 1.5), (3.0, 1.6), (4.0, 1.2), (12.9, 1.6), (13.0, 1.6), (14.0, 1.0)]
    assert [now_s for now_s, value in steps if band.passes((value,), now_s)] == [0.0, 3.0, 13.0, 14.0]


def test_slow_drift_passes_in_the_end() -> None:
    """What counts is how far it went since the last that passed, not since the last."""
    band = Deadband(1.0, max_s=0.0)
    passed = [i / 100 for i in range(1000) if band.passes((i / 100,), float(i))]
    assert len(passed) == 10
    assert max(later - before for before, later in pairwise(passed)) < 1.02


def test_any_field_and_becoming_a_number_are_moves() -> None:
    band = Deadband(0.1, max_s=0.0)
    values = [(1.0, math.nan), (1.0, math.nan), (1.0, 2.0), (1.0, 2.05), (1.0, math.nan), (1.2, math.nan)]
    assert [band.passes(value, 0.0) for value in values] == [True, False, True, False, True, True]
    band.reset()
    assert band.passes(values[-1], 0.0)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1), st.floats(1e-3, 1e3))
def test_what_was_last_let_through_is_never_further_away_than_the_band(values: list[float], width: float) -> None:
    band, shown = Deadband(width, max_s=0.0), math.nan
    for value in values:
        if band.passes((value,), 0.0):
            shown = value
        assert abs(value - shown) <= width


def test_samples_that_cannot_be_read_pass() -> None:
    def read(payload: bytes) -> tuple[float, ...]:
        if not payload:
            raise DecodeError("too short")
        return (float(payload[0]),)

    band = SampleDeadband(read, 5.0, max_s=0.0)
    assert [band.passes(data, 0.0) for data in (b"\x01", b"\x04", b"", b"\x07")] == [True, False, True, True]


def test_each_series_has_a_dead_band_of_its_own() -> None:
    extractor = MetricExtractor((7, 9), lambda p: (float(p[0]), float(p[1])), rate_hz=0, deadband=2, deadband_max_s=60)
    payloads = [bytes(pair) for pair in ((1, 1), (2, 9), (4, 9))]
    rows = [extractor.rows(payload, float(i)) for i, payload in enumerate(payloads)]
    assert rows == [[(7, 1.0), (9, 1.0)], [(9, 9.0)], [(7, 4.0)]]
    assert extractor.rows(payloads[-1], 61.0) == [(9, 9.0)]


def test_fast_sources_are_thinned_to_the_same_moments() -> None:
    limiters = [RateLimiter(2.0) for _ in range(5)]
    taken = [
        [moment for i in range(500) if limiter.admit(moment := 100.0 + phase + i / 50)]
        for limiter, phase in zip(limiters, (0.0, 0.004, 0.008, 0.012, 0.016), strict=True)
    ]
    for moments in zip(*(moments[1:] for moments in taken), strict=True):
        assert max(moments) - min(moments) < 1 / 50
    assert all(later - earlier == pytest.approx(0.5, abs=1 / 49) for earlier, later in pairwise(taken[0][1:]))
