"""What happens in a launch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from metaros.ros2.launch.events import process

__all__ = ["ExecutionComplete", "Shutdown", "TimerEvent", "process"]


@dataclass(kw_only=True)
class Shutdown:
    """The launch ends."""

    reason: str = "reason not given"
    due_to_sigint: bool = False
    name = "launch.events.Shutdown"


@dataclass(kw_only=True)
class ExecutionComplete:
    """An action is done, and all that it has started."""

    action: Any
    name = "launch.events.ExecutionComplete"


@dataclass(kw_only=True)
class TimerEvent:
    """A timer's time has come."""

    timer_action: Any
    name = "launch.events.TimerEvent"
