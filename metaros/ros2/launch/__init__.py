"""`launch`: Python launch files as ROS 2 has them, run over this library's supervised processes.

Understood: descriptions, arguments, configurations, substitutions, conditions, groups, includes, timers, processes,
event handlers. Not understood, and said so when met: XML and YAML files, terminals of processes, composable nodes.
"""

from __future__ import annotations

from metaros.ros2.launch import (
    actions,
    conditions,
    descriptions,
    event_handlers,
    events,
    launch_description_sources,
    substitutions,
)
from metaros.ros2.launch.conditions import Condition
from metaros.ros2.launch.entities import Action, LaunchDescription, LaunchDescriptionEntity, SomeActionsType
from metaros.ros2.launch.event_handlers import EventHandler
from metaros.ros2.launch.launch_context import LaunchContext
from metaros.ros2.launch.launch_description_sources import LaunchDescriptionSource
from metaros.ros2.launch.launch_service import LaunchService
from metaros.ros2.launch.substitution import SomeSubstitutionsType, Substitution

__all__ = [
    "Action",
    "Condition",
    "EventHandler",
    "LaunchContext",
    "LaunchDescription",
    "LaunchDescriptionEntity",
    "LaunchDescriptionSource",
    "LaunchService",
    "SomeActionsType",
    "SomeSubstitutionsType",
    "Substitution",
    "actions",
    "conditions",
    "descriptions",
    "event_handlers",
    "events",
    "launch_description_sources",
    "substitutions",
]
