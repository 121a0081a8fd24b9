"""Token buckets: how much, how soon again, and how many of them."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.buckets import TokenBuckets


def test_a_burst_then_the_rate() -> None:
    buckets = TokenBuckets(per_s=2.0, burst=3.0)
    assert [buckets.take("a", 0.0) for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    assert buckets.take("b", 0.0) == 0.0
    assert buckets.take("a", 0.5) == 0.0
    assert buckets.take("a", 0.6) > 0.0


def test_looking_takes_nothing_and_what_is_given_back_is_there_again() -> None:
    buckets = TokenBuckets(per_s=1.0, burst=1.0)
    assert [buckets.wait_s("a", 0.0), buckets.take("a", 0.0), buckets.wait_s("a", 0.0)] == [0.0, 0.0, 1.0]
    buckets.give("a", 0.0)
    assert buckets.take("a", 0.0) == 0.0


def test_more_than_the_burst_at_once_is_paid_for_afterwards() -> None:
    buckets = TokenBuckets(per_s=10.0, burst=5.0)
    assert buckets.take("a", 0.0, 25.0) == 0.0
    assert buckets.take("a", 0.0) == 2.1


def test_no_rate_is_no_limit() -> None:
    buckets = TokenBuckets(per_s=0.0, burst=0.0)
    assert all(buckets.take("a", 0.0) == 0.0 for _ in range(1000))
    assert len(buckets) == 0


def test_the_one_used_longest_ago_is_forgotten_and_full_ones_are() -> None:
    buckets = TokenBuckets(per_s=1.0, burst=2.0, most=2)
    for key in "abc":
        buckets.take(key, 0.0, 2.0)
    assert len(buckets) == 2
    assert [buckets.wait_s(key, 0.0) for key in "abc"] == [0.0, 1.0, 1.0]
    buckets.give("b", 0.0, 2.0)
    assert len(buckets) == 1


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(0, 2), st.floats(0.1, 3)), max_size=60))
def test_never_more_than_the_rate_and_a_burst(steps: list[tuple[float, float]]) -> None:
    buckets, now, taken, last = TokenBuckets(per_s=3.0, burst=4.0), 0.0, 0.0, 0.0
    for pause, amount in steps:
        now += pause
        if buckets.take("a", now, amount) == 0.0:
            taken += amount
            last = amount
    assert taken <= 4.0 + 3.0 * now + last + 1e-6
