"""Goals as an agent keeps them: feedback at its rate, ends that are kept for a while, bounds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from edge_agent.errors import BusyError
from edge_agent.ros.goal_registry import GoalRegistry, TrackedGoal
from metaros.clock import ManualClock
from metaros.limits import LIMITS


def begin(registry: GoalRegistry, number: int) -> TrackedGoal:
    return registry.begin(number.to_bytes(16, "big"), "/r/dock", "p/action/A", "RIHS01_00")


def test_of_feedback_the_newest_is_reported_at_its_rate(clock: ManualClock) -> None:
    registry = GoalRegistry(clock)
    goal = begin(registry, 1)
    registry.fed_back(goal.goal_id, b"one")
    assert [event.feedback for event in registry.due()] == [b"one"]
    registry.fed_back(goal.goal_id, b"two")
    registry.fed_back(goal.goal_id, b"three", skipped=2)
    assert (registry.due(), registry.waits) == ([], True)
    clock.advance(2 / LIMITS.goal_feedback_hz)
    reported = registry.due()
    assert ([event.feedback for event in reported], reported[0].skipped, registry.waits) == ([b"three"], 3, False)
    registry.fed_back(goal.goal_id, b"x" * (LIMITS.goal_feedback_bytes + 1))
    assert (registry.waits, goal.skipped) == (False, 4)


def test_feedback_of_many_goals_takes_turns(clock: ManualClock) -> None:
    registry = GoalRegistry(clock)
    for number in range(8):
        registry.fed_back(begin(registry, number).goal_id, bytes(LIMITS.goal_feedback_bytes))
    turns = []
    while registry.waits:
        turns.append(len(registry.due()))
    assert (sum(turns), max(turns)) == (8, 4)  # of 64 KiB each, 256 KiB a turn


def test_states_only_go_forward_and_nothing_follows_an_end(clock: ManualClock) -> None:
    registry = GoalRegistry(clock)
    goal = begin(registry, 1)
    assert registry.status(goal.goal_id, 2) is goal
    assert registry.status(goal.goal_id, 1) is None
    assert registry.status(goal.goal_id, 4) is None  # its result says that
    registry.end(goal, status=4, result=b"result")
    registry.fed_back(goal.goal_id, b"late")
    assert (registry.waits, registry.status(goal.goal_id, 3)) == (False, None)
    assert (goal.event().ended, goal.event().result) == (True, b"result")


def test_ends_are_kept_for_a_while_and_goals_are_bounded(clock: ManualClock) -> None:
    registry = GoalRegistry(clock, limits=replace(LIMITS, goals_open=2, goals_kept=3))
    goals = [begin(registry, number) for number in range(2)]
    with pytest.raises(BusyError):
        begin(registry, 9)
    for goal in goals:
        registry.end(goal, status=4)
    begin(registry, 3)
    begin(registry, 4)  # the oldest ended one makes room
    assert [goal.goal_id[-1] for goal in registry.all()] == [1, 3, 4]
    clock.advance(LIMITS.goal_kept_s + 1)
    assert [goal.goal_id[-1] for goal in registry.all()] == [3, 4]
