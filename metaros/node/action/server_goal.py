"""A goal as the callbacks of its server see it."""

from __future__ import annotations

import threading
from typing import Any, Protocol

from metaros.node.action.goal import Goal, GoalEvent, GoalState
from metaros.node.service import PendingRequest

__all__ = ["ServerGoal"]


class GoalServer(Protocol):
    """What a goal needs of the server that accepted it, which is an `ActionServer`."""

    name: str

    def start(self, handle: ServerGoal) -> None:
        """Run `execute` for it."""

    def feed_back(self, handle: ServerGoal, feedback: Any) -> None:
        """Publish feedback."""

    def end(self, handle: ServerGoal, event: GoalEvent, result: Any) -> None:
        """Bring it to its end."""


class ServerGoal:
    """A goal that was accepted. Thread-safe: `execute` may run on one thread and be cancelled from another."""

    def __init__(self, server: GoalServer, goal: Goal, request: Any, entry: Any) -> None:
        self._server = server
        self._stop = threading.Event()
        self.goal = goal
        self.request = request  # the Goal message
        # What follows is the server's, under its lock.
        self.entry = entry  # its line in the status topic
        self.started = False
        self.running = False
        self.response: bytes | None = None  # the CDR of the GetResult response, once the goal and its result are there
        self.waiters: list[PendingRequest] = []

    @property
    def goal_id(self) -> bytes:
        """16 bytes."""
        return self.goal.goal_id

    @property
    def status(self) -> GoalState:
        """Where it is in its life."""
        return self.goal.state

    @property
    def is_active(self) -> bool:
        """Whether it has not reached its end."""
        return self.goal.is_active

    @property
    def is_cancel_requested(self) -> bool:
        """Whether a client cancels it and the server agreed: tidy up, then call `canceled`."""
        return self.goal.state is GoalState.CANCELING

    @property
    def should_stop(self) -> bool:
        """Whether there is no point in going on: cancelled, ended by somebody else, or the server closes."""
        return self._stop.is_set()

    def pause(self, seconds: float) -> bool:
        """Wait so long on a thread of `execute`, or until it should stop; returns whether it should."""
        return self._stop.wait(seconds)

    def execute(self) -> None:
        """Start `execute`, for a goal that `handle_accepted` kept for later; UsageError the second time."""
        self._server.start(self)

    def publish_feedback(self, feedback: Any) -> None:
        """Tell the client how far it is; nothing is sent for a goal that has ended."""
        self._server.feed_back(self, feedback)

    def succeed(self, result: Any = None) -> None:
        """It is done. Without a result here, what `execute` returns is the result."""
        self._server.end(self, GoalEvent.SUCCEED, result)

    def abort(self, result: Any = None) -> None:
        """It cannot be done; also for a goal that has not begun, and to make room for another."""
        self._server.end(self, GoalEvent.ABORT, result)

    def canceled(self, result: Any = None) -> None:
        """It has stopped, as the client wished; UsageError unless a cancel was requested."""
        self._server.end(self, GoalEvent.CANCELED, result)

    def stop(self) -> None:
        """Make `should_stop` true."""
        self._stop.set()

    def __repr__(self) -> str:
        return f"<goal {self.goal_id.hex()} of {self._server.name}: {self.status.name}>"
