"""The errors of rollouts; their codes are rows of the gateway's table.

RequestError
├── UnknownRolloutError      there is no such rollout                              unknown_rollout
└── RolloutStateError        it is over, or halted, or another one is in its way   rollout_state
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = ["RolloutStateError", "UnknownRolloutError"]


class UnknownRolloutError(RequestError):
    """There is no such rollout."""

    code = "unknown_rollout"


class RolloutStateError(RequestError):
    """The rollout is not in a state for that, or another one is at the same robots."""

    code = "rollout_state"
