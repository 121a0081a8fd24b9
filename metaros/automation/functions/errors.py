"""The engine's errors: a call that was throttled, an engine that was closed, a runtime that is not supported.

What a function does wrong is no error of the engine: it is an Outcome.
"""

from __future__ import annotations

from metaros.errors import ClosedError, UnavailableError, UsageError

__all__ = ["ENGINE_FULL", "RESERVED_FULL", "EngineClosedError", "RuntimeRefusedError", "ThrottledError"]

ENGINE_FULL = "ConcurrentInvocationLimitExceeded"
RESERVED_FULL = "ReservedFunctionConcurrentInvocationLimitExceeded"


class ThrottledError(UnavailableError):
    """No capacity for the call now; `reason` is AWS's word for which bound it met."""

    code = "throttled"

    def __init__(self, message: str, *, reason: str = ENGINE_FULL) -> None:
        super().__init__(message)
        self.reason = reason


class EngineClosedError(ClosedError):
    """The engine was closed, before the call or while it ran: nobody knows what it did."""

    code = "engine_closed"


class RuntimeRefusedError(UsageError):
    """The function wants a runtime that is not run here; the message names it."""

    code = "runtime_refused"
