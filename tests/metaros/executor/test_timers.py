"""Timers, by a clock that only moves when told."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.errors import UsageError
from metaros.executor import TimerHeap


def run_due(heap: TimerHeap) -> int:
    count = 0
    while (timer := heap.pop_due()) is not None:
        timer.callback()
        count += 1
    return count


def test_a_timer_is_due_once_a_period(clock):
    calls: list[float] = []
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    heap.add(0.5, lambda: calls.append(clock.monotonic_s()))
    assert run_due(heap) == 0
    for _ in range(4):
        clock.advance(0.25)
        run_due(heap)
    assert calls == [1000.5, 1001.0]


def test_missed_periods_are_skipped_not_made_up_for(clock):
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    heap.add(0.1, lambda: None)
    clock.advance(10.05)
    assert run_due(heap) == 1
    due_s = heap.next_due_s()
    assert due_s is not None
    assert due_s == pytest.approx(clock.monotonic_s() + 0.05)


def test_timers_are_served_in_the_order_of_their_times(clock):
    order: list[str] = []
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    heap.add(0.3, lambda: order.append("slow"))
    heap.add(0.1, lambda: order.append("fast"))
    clock.advance(0.31)
    run_due(heap)
    assert order == ["fast", "slow"]


def test_a_cancelled_timer_rests_until_reset(clock):
    calls: list[int] = []
    changed: list[int] = []
    heap = TimerHeap(clock.monotonic_s, lambda: changed.append(1))
    timer = heap.add(1.0, lambda: calls.append(1))
    timer.cancel()
    clock.advance(5.0)
    assert run_due(heap) == 0
    assert heap.next_due_s() is None
    timer.reset()
    assert not timer.cancelled
    clock.advance(1.0)
    assert run_due(heap) == 1
    assert (calls, changed) == ([1], [1, 1])


@pytest.mark.parametrize("period_s", [0, -1, float("inf"), float("nan")])
def test_a_period_that_makes_no_sense_is_refused(clock, period_s):
    with pytest.raises(UsageError, match="period"):
        TimerHeap(clock.monotonic_s, lambda: None).add(period_s, lambda: None)


@given(st.lists(st.floats(1e-9, 1e3), min_size=1, max_size=5), st.lists(st.floats(0, 1e3), max_size=20))
def test_whatever_the_periods_serving_ends_and_the_next_time_lies_ahead(periods, steps):
    clock = ManualClock()
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    for period_s in periods:
        heap.add(period_s, lambda: None)
    for step in steps:
        clock.advance(step)
        run_due(heap)
        due_s = heap.next_due_s()
        assert due_s is not None
        assert due_s > clock.monotonic_s()
