"""`ServerGoalHandle`: a goal as the callbacks of its server see it."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from types import GenericAlias
from typing import Any, Protocol

from metaros.node.action.goal import Goal, GoalState
from metaros.node.action.goal import GoalEvent as NativeEvent
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.execution.task import Future

__all__ = ["GoalEvent", "ServerGoalHandle"]


class GoalEvent(Enum):
    """What changes a goal's state."""

    EXECUTE = 0
    CANCEL_GOAL = 1
    SUCCEED = 2
    ABORT = 3
    CANCELED = 4

    @property
    def native(self) -> NativeEvent:
        """The library's own."""
        return _NATIVE[self]


_NATIVE = {
    GoalEvent.EXECUTE: NativeEvent.EXECUTE,
    GoalEvent.CANCEL_GOAL: NativeEvent.CANCEL,
    GoalEvent.SUCCEED: NativeEvent.SUCCEED,
    GoalEvent.ABORT: NativeEvent.ABORT,
    GoalEvent.CANCELED: NativeEvent.CANCELED,
}


class GoalServer(Protocol):
    """What a goal needs of the server that accepted it, which is an `ActionServer`."""

    def notify_execute(self, goal_handle: Any, execute_callback: Callable[[Any], Any] | None) -> None:
        """Have the executor run it."""

    def _update_state(self, goal_handle: Any, event: GoalEvent) -> None:
        """RCLError where the goal's state does not allow it."""

    def _feed_back(self, goal_handle: Any, feedback: Any) -> None:
        """Publish feedback; TypeError where it is of another class."""

    def _set_result(self, goal_handle: Any, result: Any) -> None:
        """Answer who waits for the result."""


class ServerGoalHandle:
    """A goal that was accepted. Action servers make them; thread-safe."""

    __class_getitem__: Any = classmethod(GenericAlias)

    def __init__(self, action_server: GoalServer, goal: Goal, goal_info: Any, goal_request: Any) -> None:
        self._action_server = action_server
        self._goal: Goal | None = goal  # None once it was destroyed
        self._goal_info = goal_info
        self._goal_request = goal_request
        self._status_entry: Any = None  # its line in the status topic
        self._result_future = Future[Any]()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ServerGoalHandle) and bool(self.goal_id == other.goal_id)

    __hash__ = object.__hash__

    @property
    def request(self) -> Any:
        """The Goal message."""
        return self._goal_request

    @property
    def goal_id(self) -> Any:
        """A UUID message."""
        return self._goal_info.goal_id

    @property
    def is_active(self) -> bool:
        """Whether it has not reached its end."""
        goal = self._goal
        return goal is not None and goal.is_active

    @property
    def is_cancel_requested(self) -> bool:
        """Whether a client cancels it and the server agreed: tidy up, then call `canceled`."""
        return self.status == GoalState.CANCELING

    @property
    def status(self) -> int:
        """A number of action_msgs/msg/GoalStatus."""
        goal = self._goal
        return int(GoalState.UNKNOWN if goal is None else goal.state)

    def executing(self) -> None:
        """It runs now; does nothing to a goal that is to be canceled, which its callback finds out."""
        try:
            self._update_state(GoalEvent.EXECUTE)
        except RCLError:
            if not self.is_cancel_requested:  # a cancel may come at any moment
                raise

    def execute(self, execute_callback: Callable[[Any], Any] | None = None) -> None:
        """Have the executor run `execute_callback(goal_handle)`, or the server's own; RCLError the second time."""
        self.executing()
        self._action_server.notify_execute(self, execute_callback)

    def publish_feedback(self, feedback: Any) -> None:
        """Tell the client how far it is; TypeError for what is no Feedback message of the action."""
        self._action_server._feed_back(self, feedback)

    def succeed(self, result: Any = None) -> None:
        """It is done. Without a result here, what the execute callback returns is the result."""
        self._end(GoalEvent.SUCCEED, result)

    def abort(self, result: Any = None) -> None:
        """It cannot be done."""
        self._end(GoalEvent.ABORT, result)

    def canceled(self, result: Any = None) -> None:
        """It has stopped, as the client wished."""
        self._end(GoalEvent.CANCELED, result)

    def destroy(self) -> None:
        """Forget it: nothing more is sent for it."""
        self._goal = None

    def _end(self, event: GoalEvent, result: Any) -> None:
        self._update_state(event)
        if result is not None:
            self._action_server._set_result(self, result)

    def _update_state(self, event: GoalEvent) -> None:
        """RCLError where the state does not allow it; nothing for a goal that was destroyed."""
        if self._goal is not None:
            self._action_server._update_state(self, event)
