"""The errors of what clients do in robots' ROS graphs. Their codes are rows of the gateway's table.

RequestError
├── UnknownServiceError      the robot's graph has no such service                  unknown_service
├── UnknownActionError       the robot's graph has no such action                   unknown_action
├── UnknownGoalError         no such goal is known, or not any more                 unknown_goal
├── GoalRejectedError        the action's server does not take the goal             goal_rejected
└── OfferRefusedError        the robot cannot offer that service or action          offer_refused
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = [
    "GoalRejectedError",
    "OfferRefusedError",
    "UnknownActionError",
    "UnknownGoalError",
    "UnknownServiceError",
]


class UnknownServiceError(RequestError):
    """The robot's graph has no service of that name, so that its type is not known."""

    code = "unknown_service"


class UnknownActionError(RequestError):
    """The robot's graph has no action of that name."""

    code = "unknown_action"


class UnknownGoalError(RequestError):
    """No goal of that id was sent through this gateway, or it ended long ago."""

    code = "unknown_goal"


class GoalRejectedError(RequestError):
    """The server looked at the goal and does not want it."""

    code = "goal_rejected"


class OfferRefusedError(RequestError):
    """The robot's agent cannot put that service or action into its graph; says why."""

    code = "offer_refused"
