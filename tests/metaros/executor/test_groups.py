"""Callback groups: who may run now, and in which turn those run that had to wait."""

from __future__ import annotations

from metaros.executor.groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup


def test_who_waits_for_a_group_runs_in_the_order_of_waiting() -> None:
    group = MutuallyExclusiveCallbackGroup()
    assert [group.enter(job) for job in ("first", "second", "third", "fourth")] == [True, False, False, False]
    assert group.leave() == "second"
    assert not group.enter("late")  # the second one is in now
    assert [group.leave() for _ in range(4)] == ["third", "fourth", "late", None]
    assert group.enter("again")


def test_nobody_waits_for_a_reentrant_group() -> None:
    group = ReentrantCallbackGroup()
    assert [group.enter("a"), group.enter("a"), group.leave()] == [True, True, None]
