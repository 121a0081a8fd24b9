"""How long an action's endpoints stay after its last goal."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from edge_agent.forwarding.scope import Scope
from edge_agent.ros import goals
from edge_agent.ros.goals import GoalRunner
from metaros.clock import ManualClock


class Ends:
    """An action's endpoints, without a network."""

    def __init__(self, name: str, users: int) -> None:
        self.name, self.users = name, users
        self.closes = 0

    def close(self) -> None:
        self.closes += 1


async def test_only_endpoints_that_nobody_uses_by_then_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goals, "IDLE_S", 0.0)
    no_node: Any = None
    runner = GoalRunner(no_node, Scope(), ManualClock())
    idle, shared, taken_up, replaced, newer = (
        Ends(name, users) for name, users in (("/a", 1), ("/b", 2), ("/c", 1), ("/d", 1), ("/d", 0))
    )
    actions: dict[str, Any] = {"/a": idle, "/b": shared, "/c": taken_up, "/d": newer}
    runner._actions = actions
    for ends in (idle, shared, taken_up, replaced):
        gone: Any = ends
        runner._let_go(gone)
    taken_up.users += 1  # another goal came meanwhile
    assert idle.closes == 0
    later = asyncio.Event()
    asyncio.get_running_loop().call_later(0.0, later.set)
    await later.wait()
    assert [ends.closes for ends in (idle, shared, taken_up, replaced, newer)] == [1, 0, 0, 0, 0]
    assert set(actions) == {"/b", "/c", "/d"}
