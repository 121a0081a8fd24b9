"""The fair schedule's arithmetic: equations (1) and (2), by hand and over any load."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import UsageError
from metaros.executor.fair_schedule import BASE_WEIGHT, NICE_WEIGHTS, FairSchedule, weight_of


def run(schedule: FairSchedule[str], seconds: float, *, step_s: float = 0.001) -> None:
    """CPU-bound callbacks of `step_s` each, for so long."""
    left = round(seconds / step_s)
    while left > 0:
        turn = schedule.pick()
        assert turn is not None
        slice_s = turn.slice_s
        while slice_s > 0 and left > 0:
            schedule.charge(turn.key, step_s)
            slice_s -= step_s
            left -= 1


def test_the_weights_are_the_kernels():
    assert (weight_of(-20), weight_of(-5), weight_of(0), weight_of(5), weight_of(19)) == (88761, 3121, 1024, 335, 15)
    assert sorted(NICE_WEIGHTS) == list(range(-20, 20))
    assert all(1.15 < NICE_WEIGHTS[nice] / NICE_WEIGHTS[nice + 1] < 1.3 for nice in range(-20, 19))


@pytest.mark.parametrize("nice", [-21, 20, 0.5, None])
def test_other_levels_are_refused(nice):
    with pytest.raises(UsageError, match="nice"):
        weight_of(nice)


def test_a_slice_is_the_weights_part_of_the_period():
    schedule = FairSchedule[str](period_s=0.02)
    for name, nice in (("a", -5), ("b", 0), ("c", 5)):
        schedule.add(name, nice=nice)
        schedule.wake(name)
    turn = schedule.pick()
    assert turn is not None
    assert turn.key == "a"  # the first of equals
    assert turn.slice_s == pytest.approx(0.02 * 3121 / (3121 + 1024 + 335))


def test_virtual_runtime_grows_by_the_inverse_of_the_weight():
    schedule = FairSchedule[str]()
    schedule.add("a", nice=-5)
    schedule.charge("a", 3.0)
    assert schedule.virtual_s("a") == pytest.approx(3.0 * BASE_WEIGHT / 3121)
    assert schedule.run_s("a") == 3.0


def test_three_busy_nodes_share_by_weight():
    schedule = FairSchedule[str]()
    levels = {"a": -5, "b": 0, "c": 5}
    for name, nice in levels.items():
        schedule.add(name, nice=nice)
        schedule.wake(name)
    run(schedule, 10.0)
    total = sum(weight_of(nice) for nice in levels.values())
    for name, nice in levels.items():
        assert schedule.run_s(name) / 10.0 == pytest.approx(weight_of(nice) / total, rel=0.05)


def test_a_late_sleeper_is_neither_starved_nor_favoured():
    schedule = FairSchedule[str]()
    for name in ("early", "late"):
        schedule.add(name)
    schedule.wake("early")
    run(schedule, 10.0)
    schedule.wake("late")
    run(schedule, 0.1)
    assert 0.05 <= schedule.run_s("late") <= 0.05 + 2 * schedule.period_s  # at once, but no ten seconds to catch up
    run(schedule, 10.0)
    assert schedule.run_s("late") == pytest.approx(5.05, rel=0.01)


def test_who_naps_now_and_then_loses_nothing_and_wins_nothing():
    schedule = FairSchedule[str]()
    for name in ("steady", "napping"):
        schedule.add(name)
    schedule.wake("steady")
    for _ in range(500):
        schedule.wake("napping")
        run(schedule, 0.01)
        schedule.sleep("napping")
    assert schedule.run_s("napping") == pytest.approx(2.5, rel=0.05)


def test_renice_counts_from_now_on():
    schedule = FairSchedule[str]()
    for name in ("a", "b"):
        schedule.add(name)
        schedule.wake(name)
    run(schedule, 1.0)
    before = schedule.run_s("a")
    schedule.renice("a", 5)
    run(schedule, 10.0)
    assert (schedule.run_s("a") - before) / 10.0 == pytest.approx(335 / (335 + 1024), rel=0.05)


def test_misuse_is_named():
    schedule = FairSchedule[str]()
    assert schedule.pick() is None
    schedule.add("a")
    with pytest.raises(UsageError, match="already"):
        schedule.add("a")
    schedule.wake("a")
    schedule.wake("a")
    schedule.remove("a")
    assert schedule.pick() is None
    with pytest.raises(UsageError, match="period"):
        FairSchedule(period_s=0)


@settings(max_examples=50)
@given(
    st.lists(st.tuples(st.integers(0, 4), st.sampled_from(["wake", "sleep", "run"]), st.floats(0, 0.05)), max_size=200)
)
def test_whatever_happens_nobody_with_work_falls_behind(events):
    schedule = FairSchedule[int]()
    for key in range(5):
        schedule.add(key, nice=4 * key - 8)
    for key, event, seconds in events:
        if event == "wake":
            schedule.wake(key)
        elif event == "sleep":
            schedule.sleep(key)
        elif (turn := schedule.pick()) is not None:
            others = [schedule.virtual_s(k) for k in range(5) if schedule.is_runnable(k)]
            assert schedule.virtual_s(turn.key) == min(others)
            assert 0 < turn.slice_s <= schedule.period_s
            schedule.charge(turn.key, seconds)
