"""Events of nodes."""

from __future__ import annotations

from metaros.ros2.launch_ros.events import lifecycle, matchers

__all__ = ["lifecycle", "matchers"]
