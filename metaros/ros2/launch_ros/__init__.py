"""`launch_ros`: nodes in launch files, with names, namespaces, parameters and remappings.

Not understood, and said so when met: containers and composable nodes, which are C++.
"""

from __future__ import annotations

from metaros.ros2.launch_ros import (
    actions,
    descriptions,
    event_handlers,
    events,
    parameter_descriptions,
    substitutions,
)

__all__ = ["actions", "descriptions", "event_handlers", "events", "parameter_descriptions", "substitutions"]
