"""How a wait of an executor ends, other than with something to run."""

from __future__ import annotations

__all__ = [
    "ConditionReachedException",
    "ExternalShutdownException",
    "ShutdownException",
    "TimeoutException",
    "TimeoutObject",
]


class TimeoutException(Exception):
    """Nothing was ready in time."""


class ShutdownException(Exception):
    """The executor was shut down."""


class ExternalShutdownException(Exception):
    """The context was shut down under who spins."""


class ConditionReachedException(Exception):
    """What was waited for is so, such as a future that is done."""


class TimeoutObject:
    """A timeout in seconds that changes while somebody uses it."""

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
