"""A goal as the client that sent it sees it."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple, Protocol

from metaros.node.action.goal import TERMINAL, GoalState
from metaros.node.pending_call import Reply

__all__ = ["ActionResult", "ClientGoal"]


class ActionResult(NamedTuple):
    """How a goal ended, and the Result message it gave."""

    status: GoalState
    result: Any


class GoalClient(Protocol):
    """What a goal needs of the client that sent it, which is an `ActionClient`."""

    name: str

    def get_result(self, goal: ClientGoal, timeout_s: float | None) -> Reply[ActionResult]:
        """Ask for its end."""

    def cancel_goal(self, goal: ClientGoal, timeout_s: float) -> Reply[bool]:
        """Ask the server to stop it."""


class ClientGoal:
    """A goal that was sent. Whether it was taken is in `accepted`; the rest makes sense only then."""

    def __init__(self, client: GoalClient, goal_id: bytes, *, accepted: bool, stamp_ns: int) -> None:
        self._client = client
        self.goal_id = goal_id
        self.accepted = accepted
        self.stamp_ns = stamp_ns  # when the server accepted it
        self._lock = threading.Lock()
        self._status = GoalState.ACCEPTED if accepted else GoalState.UNKNOWN

    @property
    def status(self) -> GoalState:
        """What the server last said, while the client's node spins; the end also by `result`."""
        return self._status

    def result(self, timeout_s: float | None = None) -> Reply[ActionResult]:
        """Its end, to `await` or `.wait()` for; None as the timeout waits as long as the server lives.

        PeerRestartedError at once when the server dies, or was restarted and does not know the goal;
        UnavailableError when its end was told and the server has forgotten the result since.
        """
        return self._client.get_result(self, timeout_s)

    def cancel(self, timeout_s: float = 10.0) -> Reply[bool]:
        """Ask the server to stop it; gives whether the server will. The goal's end is still told by `result`."""
        return self._client.cancel_goal(self, timeout_s)

    def learn(self, status: GoalState) -> None:
        """The server says so, by its answers and by its status topic, in any order: a goal goes only forward."""
        with self._lock:
            if self._status not in TERMINAL:
                self._status = max(self._status, status)

    def __repr__(self) -> str:
        return f"<goal {self.goal_id.hex()} of {self._client.name}: {self.status.name}>"
