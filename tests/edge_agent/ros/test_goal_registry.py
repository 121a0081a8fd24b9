"""Goals as an agent keeps them: feedback at its rate, ends that are kept for a while, bounds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from edge_agent.errors import BusyError
from edge_agent.ros.goal_book import GoalBook, Kept
from metaros.clock import ManualClock
from metaros.limits import LIMITS


def begin(book: GoalBook, number: int) -> Kept:
    return book.begin(number.to_bytes(16, "big"), "/r/dock", "p/action/A", "RIHS01_00")


def test_of_feedback_the_newest_is_told_at_its_rate(clock: ManualClock) -> None:
    book = GoalBook(clock)
    goal = begin(book, 1)
    book.fed_back(goal.goal_id, b"one")
    assert [event.feedback for event in book.due()] == [b"one"]
    book.fed_back(goal.goal_id, b"two")
    book.fed_back(goal.goal_id, b"three", skipped=2)
    assert (book.due(), book.waits) == ([], True)
    clock.advance(2 / LIMITS.goal_feedback_hz)
    told = book.due()
    assert ([event.feedback for event in told], told[0].skipped, book.waits) == ([b"three"], 3, False)
    book.fed_back(goal.goal_id, b"x" * (LIMITS.goal_feedback_bytes + 1))
    assert (book.waits, goal.skipped) == (False, 4)


def test_feedback_of_many_goals_takes_turns(clock: ManualClock) -> None:
    book = GoalBook(clock)
    for number in range(8):
        book.fed_back(begin(book, number).goal_id, bytes(LIMITS.goal_feedback_bytes))
    turns = []
    while book.waits:
        turns.append(len(book.due()))
    assert (sum(turns), max(turns)) == (8, 4)  # of 64 KiB each, 256 KiB a turn


def test_states_only_go_forward_and_nothing_follows_an_end(clock: ManualClock) -> None:
    book = GoalBook(clock)
    goal = begin(book, 1)
    assert book.status(goal.goal_id, 2) is goal
    assert book.status(goal.goal_id, 1) is None
    assert book.status(goal.goal_id, 4) is None  # its result says that
    book.end(goal, status=4, result=b"result")
    book.fed_back(goal.goal_id, b"late")
    assert (book.waits, book.status(goal.goal_id, 3)) == (False, None)
    assert (goal.event().ended, goal.event().result) == (True, b"result")


def test_ends_are_kept_for_a_while_and_goals_are_bounded(clock: ManualClock) -> None:
    book = GoalBook(clock, limits=replace(LIMITS, goals_open=2, goals_kept=3))
    goals = [begin(book, number) for number in range(2)]
    with pytest.raises(BusyError):
        begin(book, 9)
    for goal in goals:
        book.end(goal, status=4)
    begin(book, 3)
    begin(book, 4)  # the oldest ended one makes room
    assert [goal.goal_id[-1] for goal in book.all()] == [1, 3, 4]
    clock.advance(LIMITS.goal_kept_s + 1)
    assert [goal.goal_id[-1] for goal in book.all()] == [3, 4]
