"""Timers, by a clock that only moves when told."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.errors import UsageError
from metaros.executor import TimerHeap
from metaros.executor.timers import TimerStatistics


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


@settings(max_examples=50)
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


def test_statistics_tell_how_late_calls_came(clock):
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    timer = heap.add(0.5, lambda: None)
    clock.advance(0.5)
    run_due(heap)
    clock.advance(1.75)  # due at 1.0; 1.5 and 2.0 pass, too
    run_due(heap)
    timer.busy = True  # an `async def` that is not done
    clock.advance(0.25)
    run_due(heap)
    assert timer.statistics == TimerStatistics(calls=2, overruns=2, missed=3, max_lateness_s=1.25)


def test_a_timer_does_not_drift(clock):
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    timer = heap.add(0.5, lambda: None)
    for _ in range(1000):  # each call comes a little late; the times it is due stay on the grid
        clock.advance(timer.due_s - clock.monotonic_s() + 0.0625)
        assert run_due(heap) == 1
    assert timer.due_s == 1000.0 + 1001 * 0.5


def test_ready_and_time_left(clock):
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    timer = heap.add(2.0, lambda: None)
    assert (timer.is_ready(), timer.time_until_next_s()) == (False, 2.0)
    clock.advance(3.0)
    assert (timer.is_ready(), timer.time_until_next_s()) == (True, -1.0)
    timer.cancel()
    assert (timer.is_ready(), timer.time_until_next_s()) == (False, None)


def test_after_a_jump_every_timer_gets_a_full_period(clock):
    heap = TimerHeap(clock.monotonic_s, lambda: None)
    timer, cancelled = heap.add(2.0, lambda: None), heap.add(1.0, lambda: None)
    cancelled.cancel()
    clock.advance(0.75)
    heap.restart_all()
    assert timer.time_until_next_s() == 2.0
    assert cancelled.cancelled
