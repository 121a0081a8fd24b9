"""What is shared by both sides of an action: its endpoints' names, and goal ids as bytes."""

from __future__ import annotations

from typing import Any, Protocol

from metaros.node.action.types import ENDPOINTS
from metaros.ros2.rclpy.core.handles import NodeHandle, Resolved
from metaros.ros2.rclpy.names.type_support import check_is_valid_action_type

__all__ = ["ActionNode", "endpoint_names", "uuid_bytes"]


class ActionNode(Protocol):
    """What an action needs of the node that it is on."""

    executor: Any

    @property
    def handle(self) -> NodeHandle:
        """The library's node."""

    @property
    def context(self) -> Any:
        """The node's context."""

    @property
    def default_callback_group(self) -> Any:
        """For what names no group."""

    def get_clock(self) -> Any:
        """Stamps of goals are by this clock."""

    def get_logger(self) -> Any:
        """The node's logger."""

    def resolve_topic_name(self, topic: str) -> str:
        """The full name, remapped."""

    def add_waitable(self, waitable: Any) -> None:
        """Make it one of the node's."""

    def remove_waitable(self, waitable: Any) -> None:
        """The reverse."""


def endpoint_names(node: ActionNode, action_type: type[Any], action_name: str) -> dict[str, Resolved]:
    """The full names of an action's five endpoints, by the keys of `ENDPOINTS`.

    A rule for the action's name moves all five; as in rcl each may have one of its own, too.

    Raises:
        AttributeError, RuntimeError: the type is no action.
        InvalidTopicNameException: the name is none.
    """
    check_is_valid_action_type(action_type)
    full, handle = node.resolve_topic_name(action_name), node.handle
    services = ("send_goal", "cancel_goal", "get_result")
    return {part: Resolved(handle.resolve(full + end, service=part in services)) for part, end in ENDPOINTS.items()}


def uuid_bytes(goal_id: Any) -> bytes:
    """The 16 bytes of a UUID message."""
    return bytes(goal_id.uuid)
