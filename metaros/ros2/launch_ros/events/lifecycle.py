"""Events of nodes with a lifecycle: what they shall do, and what they did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["ChangeState", "StateTransition"]


@dataclass(kw_only=True)
class ChangeState:
    """Ask the lifecycle nodes that match for a transition: an id of `lifecycle_msgs/msg/Transition`."""

    lifecycle_node_matcher: Callable[[Any], bool]
    transition_id: int


@dataclass(kw_only=True)
class StateTransition:
    """A lifecycle node went from one state to another. `msg` is its `lifecycle_msgs/msg/TransitionEvent`."""

    action: Any
    msg: Any

    @property
    def transition(self) -> str:
        """Its label."""
        return str(self.msg.transition.label)

    @property
    def start_state(self) -> str:
        """Where it was."""
        return str(self.msg.start_state.label)

    @property
    def goal_state(self) -> str:
        """Where it is."""
        return str(self.msg.goal_state.label)
