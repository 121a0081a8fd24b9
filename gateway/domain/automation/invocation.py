"""A call of a function as it is kept when it is over, and which of them somebody asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["ERROR", "KINDS", "OK", "ROBOT", "STATUSES", "THROTTLED", "TIMEOUT", "InvocationFilter", "Recorded"]

OK, ERROR, TIMEOUT, THROTTLED = "ok", "error", "timeout", "throttled"
STATUSES = (OK, ERROR, TIMEOUT, THROTTLED)
ROBOT = "robot"  # it ran on the robot itself
KINDS = ("request", "event", "mapping", "test", ROBOT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """One call. `id` sorts by time; `request_id` is what the function and its log know it by, in each attempt the same.

    `kind` is one of KINDS, `status` one of STATUSES. `robot` is "" where it is about no single robot. `init_ms` is 0
    where a warm worker took it. `log` is its last 4 KiB.
    """

    id: str
    request_id: str
    function: str
    version: str
    qualifier: str
    kind: str
    robot: str
    status: str
    error_type: str
    error_message: str
    began_ns: int
    duration_ms: float
    init_ms: float
    max_memory_mb: int
    log: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InvocationFilter:
    """ "" is every one; `sees` says whose robots' calls may be known, None: all."""

    function: str = ""
    status: str = ""
    version: str = ""
    kind: str = ""
    robot: str = ""
    sees: Callable[[str], bool] | None = None
