"""What the callbacks of action servers return, and the callbacks of servers that were given none."""

from __future__ import annotations

from enum import Enum
from typing import Any

__all__ = [
    "CancelResponse",
    "GoalResponse",
    "default_cancel_callback",
    "default_goal_callback",
    "default_handle_accepted_callback",
]


class GoalResponse(Enum):
    """What a goal callback returns."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(Enum):
    """What a cancel callback returns."""

    REJECT = 1
    ACCEPT = 2


def default_handle_accepted_callback(goal_handle: Any) -> None:
    """Execute it at once."""
    goal_handle.execute()


def default_goal_callback(goal_request: Any) -> GoalResponse:
    """Accept all goals."""
    return GoalResponse.ACCEPT


def default_cancel_callback(cancel_request: Any) -> CancelResponse:
    """Cancel none."""
    return CancelResponse.REJECT
