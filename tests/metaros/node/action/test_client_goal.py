"""A goal as its client sees it: what it is told may come in any order, from any thread."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from metaros.node.action.client_goal import ClientGoal
from metaros.node.action.goal import TERMINAL, GoalState


def goal() -> ClientGoal:
    client: Any = None
    return ClientGoal(client, bytes(16), accepted=True, stamp_ns=0)


@pytest.mark.parametrize("end", sorted(TERMINAL))
def test_whatever_the_order_the_furthest_state_is_the_goals(end: GoalState) -> None:
    reported = (GoalState.UNKNOWN, GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.CANCELING)
    for order in itertools.permutations(reported):
        one = goal()
        for number, status in enumerate(order):
            one.learn(status)
            assert one.status is max(GoalState.ACCEPTED, *order[: number + 1])
        one.learn(end)
        for status in (*reported, *TERMINAL):
            one.learn(status)
            assert one.status is end
