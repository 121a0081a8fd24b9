"""`ClientGoalHandle`: a goal as the client that sent it sees it."""

from __future__ import annotations

from types import GenericAlias
from typing import Any, Protocol

from metaros.node.action.goal import GoalState

__all__ = ["ClientGoalHandle"]


class GoalClient(Protocol):
    """What a goal needs of the client that sent it, which is an `ActionClient`."""

    def _cancel_goal(self, goal_handle: Any) -> Any:
        """Ask the server to stop it, and wait."""

    def _cancel_goal_async(self, goal_handle: Any) -> Any:
        """The same as a future."""

    def _get_result(self, goal_handle: Any) -> Any:
        """Wait for its end."""

    def _get_result_async(self, goal_handle: Any) -> Any:
        """The same as a future."""


class ClientGoalHandle:
    """A goal that was sent. Whether it was taken is in `accepted`; the rest makes sense only then."""

    __class_getitem__: Any = classmethod(GenericAlias)

    def __init__(self, action_client: GoalClient, goal_id: Any, goal_response: Any) -> None:
        self._action_client = action_client
        self._goal_id = goal_id
        self._goal_response = goal_response
        self._status = int(GoalState.UNKNOWN)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClientGoalHandle) and bool(self._goal_id == other.goal_id)

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        goal_id = self.goal_id.uuid
        return f"ClientGoalHandle <id={goal_id}, accepted={self.accepted}, status={self.status}>"

    @property
    def goal_id(self) -> Any:
        """A UUID message."""
        return self._goal_id

    @property
    def stamp(self) -> Any:
        """When the server accepted it: a Time message."""
        return self._goal_response.stamp

    @property
    def accepted(self) -> bool:
        """Whether the server took it."""
        return bool(self._goal_response.accepted)

    @property
    def status(self) -> int:
        """What the server's status topic last said, a number of action_msgs/msg/GoalStatus."""
        return self._status

    def cancel_goal(self) -> Any:
        """Ask the server to stop it, and wait for its answer, a CancelGoal response. Not in callbacks."""
        return self._action_client._cancel_goal(self)

    def cancel_goal_async(self) -> Any:
        """The same as a future."""
        return self._action_client._cancel_goal_async(self)

    def get_result(self) -> Any:
        """Wait for its end: a response with `status` and `result`. Not in callbacks."""
        return self._action_client._get_result(self)

    def get_result_async(self) -> Any:
        """The same as a future."""
        return self._action_client._get_result_async(self)
