"""What a launch does when a lifecycle node changes its state."""

from __future__ import annotations

from typing import Any

from metaros.ros2.launch.event_handlers import EventHandler, OnProcessExit, OnProcessIO, OnProcessStart
from metaros.ros2.launch_ros.events.lifecycle import StateTransition

__all__ = ["OnProcessExit", "OnProcessIO", "OnProcessStart", "OnStateTransition"]


class OnStateTransition(EventHandler):
    """For transitions of a lifecycle node, or of all; those alone of which more is given here."""

    def __init__(
        self,
        *,
        entities: Any,
        target_lifecycle_node: Any = None,
        transition: str | None = None,
        start_state: str | None = None,
        goal_state: str | None = None,
        **options: Any,
    ) -> None:
        wanted = {"transition": transition, "start_state": start_state, "goal_state": goal_state}

        def takes(event: Any) -> bool:
            if not isinstance(event, StateTransition) or target_lifecycle_node not in (None, event.action):
                return False
            return all(value in (None, getattr(event, name)) for name, value in wanted.items())

        super().__init__(matcher=takes, entities=entities, **options)
