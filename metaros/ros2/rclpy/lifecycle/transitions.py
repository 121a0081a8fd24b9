"""What transitions' callbacks are given and what they return, in rclpy's terms and in the library's."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

from metaros.node.lifecycle.state_machine import Result

__all__ = ["RESULTS", "RETURNS", "LifecycleState", "TransitionCallbackReturn"]


class LifecycleState(NamedTuple):
    """A state: `active` and its number in lifecycle_msgs/msg/State."""

    label: str
    state_id: int


class TransitionCallbackReturn(Enum):
    """How a transition's callback went, numbered as in lifecycle_msgs/msg/Transition."""

    SUCCESS = 97
    FAILURE = 98  # it was not done, the node is as it was before
    ERROR = 99  # it went wrong: `on_error` has to clean up

    def to_label(self) -> str:
        """The label of the transition that follows: `transition_success`."""
        return f"transition_{self.name.lower()}"


RESULTS: Final = {
    TransitionCallbackReturn.SUCCESS: Result.SUCCESS,
    TransitionCallbackReturn.FAILURE: Result.FAILURE,
    TransitionCallbackReturn.ERROR: Result.ERROR,
}
RETURNS: Final = {result: returned for returned, result in RESULTS.items()}
