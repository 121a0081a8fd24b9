"""Which nodes an event is for."""

from __future__ import annotations

from metaros.ros2.launch.events.process import matches_action, matches_executable, matches_name, matches_pid

__all__ = ["matches_action", "matches_executable", "matches_name", "matches_pid"]
