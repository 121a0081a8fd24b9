"""The goal machine alone: its table, what a cancel means, what is kept and for how long."""

from __future__ import annotations

import itertools
import math

import pytest

from metaros.errors import UsageError
from metaros.node.action.goal import TERMINAL, TRANSITIONS, CancelCode, Goal, GoalEvent, GoalState, GoalTable

NO_ID = bytes(16)


def ident(number: int) -> bytes:
    return number.to_bytes(16, "big")


def table(*stamps_ns: int, keep_s: float = 10, limit: int = 8) -> GoalTable:
    goals = GoalTable(keep_s=keep_s, limit=limit)
    for number, stamp_ns in enumerate(stamps_ns, 1):
        goals.accept(ident(number), stamp_ns)
    return goals


def end(goals: GoalTable, goal: Goal, now_s: float) -> None:
    goals.apply(goal, GoalEvent.EXECUTE, now_s)
    goals.apply(goal, GoalEvent.SUCCEED, now_s)


@pytest.mark.parametrize(("state", "event"), list(itertools.product(GoalState, GoalEvent)))
def test_every_state_and_event(state, event):
    goal = Goal(ident(1), 5, state)
    after = TRANSITIONS.get((state, event))
    assert goal.may(event) is (after is not None)
    if after is None:
        with pytest.raises(UsageError, match=f"{state.name} cannot {event.value}"):
            goal.apply(event, 7.0)
        assert (goal.state, goal.done_s) == (state, None)
    else:
        assert goal.apply(event, 7.0) is after
        assert goal.done_s == (7.0 if after in TERMINAL else None)
        assert goal.is_active is (after not in TERMINAL)


def test_ends_are_final_and_every_state_can_end():
    assert {state for state, _ in TRANSITIONS}.isdisjoint(TERMINAL)
    assert set(TRANSITIONS.values()) >= TERMINAL


@pytest.mark.parametrize(
    ("goal_id", "stamp_ns", "code", "meant"),
    [
        (ident(2), 0, CancelCode.NONE, [2]),  # an id alone
        (NO_ID, 0, CancelCode.NONE, [1, 2, 3]),  # nothing: all
        (NO_ID, 20, CancelCode.NONE, [1, 2]),  # a stamp alone: until then, inclusive
        (ident(3), 10, CancelCode.NONE, [1, 3]),  # both
        (ident(9), 10, CancelCode.NONE, [1]),
        (NO_ID, 5, CancelCode.NONE, []),
        (ident(9), 0, CancelCode.UNKNOWN_GOAL, []),
        (ident(4), 0, CancelCode.TERMINATED, []),  # it has ended
    ],
)
def test_what_a_cancel_means(goal_id, stamp_ns, code, meant):
    goals = table(10, 20, 30, 1)
    done = goals.get(ident(4))
    assert done is not None
    end(goals, done, 0.0)
    found_code, found = goals.to_cancel(goal_id, stamp_ns)
    assert found_code is code
    assert [goal.goal_id for goal in found] == [ident(number) for number in meant]


def test_a_goal_that_is_being_cancelled_cannot_be_cancelled_again():
    goals = table(10)
    (goal,) = goals.active
    goals.apply(goal, GoalEvent.CANCEL, 0.0)
    assert goals.to_cancel(ident(1), 0) == (CancelCode.TERMINATED, [])
    assert goals.to_cancel(NO_ID, 0) == (CancelCode.NONE, [])


def test_done_goals_are_kept_so_long_and_active_ones_for_ever():
    goals = table(1, 2, 3)
    first, second, _ = goals.active
    assert goals.next_expiry_s() is None
    end(goals, first, 100.0)
    end(goals, second, 104.0)
    assert goals.next_expiry_s() == 110.0
    assert goals.expire(109.9) == []
    assert goals.expire(110.0) == [first]
    assert goals.next_expiry_s() == 114.0
    assert goals.expire(1e9) == [second]
    assert len(goals) == 1


def test_results_may_be_kept_for_ever_or_not_at_all():
    for_ever, not_at_all = table(1, keep_s=math.inf), table(1, keep_s=0)
    for goals in (for_ever, not_at_all):
        end(goals, goals.active[0], 5.0)
    assert for_ever.next_expiry_s() is None
    assert for_ever.expire(1e12) == []
    assert len(not_at_all.expire(5.0)) == 1
    for keep_s in (-1.0, math.nan):
        with pytest.raises(UsageError):
            GoalTable(keep_s=keep_s, limit=1)


def test_when_full_the_oldest_done_goal_makes_room_and_active_ones_never():
    goals = table(1, 2, 3, limit=3)
    assert not goals.has_room()
    with pytest.raises(UsageError, match="the limit"):
        goals.accept(ident(4), 4)
    for number in (3, 2):
        goal = goals.get(ident(number))
        assert goal is not None
        end(goals, goal, 0.0)
    assert goals.has_room()
    goals.accept(ident(4), 4)
    assert [goal.goal_id for goal in goals.active] == [ident(1), ident(4)]
    assert goals.get(ident(3)) is None
    assert goals.get(ident(2)) is not None
    with pytest.raises(UsageError, match="exists already"):
        goals.accept(ident(1), 5)


def test_the_status_topic_lists_what_is_active_and_the_last_done():
    goals = table(1, 2, 3, 4)
    for goal in goals.active[:3]:
        end(goals, goal, 0.0)
    assert [goal.goal_id for goal in goals.listed(1)] == [ident(3), ident(4)]
    assert [goal.goal_id for goal in goals.listed(0)] == [ident(4)]
    assert len(goals.listed(9)) == 4
