"""A goal of a robot's action, as its sender holds it; the goal goes on when the holder does not."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from typing import Any, Protocol

from metaros.client.results import GoalUpdate
from metaros.errors import PeerError

__all__ = ["AsyncGoal", "Goal"]


class _Cancel(Protocol):
    def __call__(self, goal: str, /) -> bool: ...


class _AsyncCancel(Protocol):
    async def __call__(self, goal: str, /) -> bool: ...


class Goal:
    """Iterate over its updates, or wait for its result."""

    def __init__(self, goal_id: str, updates: Iterator[GoalUpdate], cancel: _Cancel) -> None:
        self.id = goal_id
        self.status = ""
        self._updates = updates
        self._cancel = cancel
        self._end: GoalUpdate | None = None

    def __iter__(self) -> Iterator[GoalUpdate]:
        """What comes, until its result."""
        for update in self._updates:
            self.status = update.status
            if update.kind == "result":
                self._end = update
            yield update

    def result(self) -> Any:
        """Wait for the end; PeerError unless it succeeded."""
        for _ in self:
            pass
        return value_of(self.id, self._end)

    def cancel(self) -> bool:
        """Ask the action's server to stop it; whether it will."""
        return self._cancel(self.id)


class AsyncGoal:
    """The same for asyncio."""

    def __init__(self, goal_id: str, updates: AsyncIterator[GoalUpdate], cancel: _AsyncCancel) -> None:
        self.id = goal_id
        self.status = ""
        self._updates = updates
        self._cancel = cancel
        self._end: GoalUpdate | None = None

    async def __aiter__(self) -> AsyncIterator[GoalUpdate]:
        """What comes, until its result."""
        async for update in self._updates:
            self.status = update.status
            if update.kind == "result":
                self._end = update
            yield update

    async def result(self) -> Any:
        """Wait for the end; PeerError unless it succeeded."""
        async for _ in self:
            pass
        return value_of(self.id, self._end)

    async def cancel(self) -> bool:
        """Ask the action's server to stop it; whether it will."""
        return await self._cancel(self.id)


def value_of(goal_id: str, end: GoalUpdate | None) -> Any:
    """The result of a goal that succeeded."""
    if end is None:
        raise PeerError(f"nobody said how goal {goal_id} ended")
    if end.status != "succeeded":
        raise PeerError(
            f"goal {goal_id} {end.status}: {end.message}" if end.message else f"goal {goal_id} {end.status}"
        )
    return end.value
