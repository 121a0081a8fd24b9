"""Events of a supervisor about its processes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Event", "EventKind"]


class EventKind(StrEnum):
    """The life of a supervised process, one word each."""

    STARTED = "started"
    READY = "ready"  # those that come after it may start
    HUNG = "hung"  # no heartbeat: it is being killed
    EXITED = "exited"
    RESTARTING = "restarting"
    QUARANTINED = "quarantined"
    ENDED = "ended"  # it will not be started again
    SAFE_STOP = "safe_stop"  # a critical process keeps dying: bring the machine to rest
    STOPPED = "stopped"  # on request
    KILLED = "killed"  # on request, but it did not stop in time


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something happened to the process `name`."""

    name: str
    kind: EventKind
    detail: str = ""
    pid: int | None = None
    restarts: int = 0
    delay_s: float = 0.0  # until the restart
