"""`rclpy.validate_full_topic_name`: names of topics and services as they are in the graph."""

from __future__ import annotations

from metaros.ros2.rclpy.names.exceptions import InvalidServiceNameException, InvalidTopicNameException
from metaros.ros2.rclpy.names.grammar import find_full_name_fault

__all__ = ["validate_full_topic_name"]


def validate_full_topic_name(name: str, *, is_service: bool = False) -> bool:
    """True for an absolute name; InvalidTopicNameException, or InvalidServiceNameException, says what is wrong."""
    fault = find_full_name_fault(name)
    if fault is None:
        return True
    if is_service:
        raise InvalidServiceNameException(name, *fault)
    raise InvalidTopicNameException(name, *fault)
