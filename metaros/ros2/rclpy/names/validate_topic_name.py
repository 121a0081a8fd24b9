"""`rclpy.validate_topic_name`: names of topics and services as programs write them."""

from __future__ import annotations

from typing import Final

from metaros.ros2.rclpy.names.exceptions import InvalidServiceNameException, InvalidTopicNameException
from metaros.ros2.rclpy.names.grammar import find_topic_name_fault

__all__ = ["TOPIC_SEPARATOR_STRING", "validate_topic_name"]

TOPIC_SEPARATOR_STRING: Final = "/"


def validate_topic_name(name: str, *, is_service: bool = False) -> bool:
    """True for a name that may still be relative, private or hold substitutions such as `{node}`.

    InvalidTopicNameException, or InvalidServiceNameException, says what is wrong with any other.
    """
    fault = find_topic_name_fault(name)
    if fault is None:
        return True
    if is_service:
        raise InvalidServiceNameException(name, *fault)
    raise InvalidTopicNameException(name, *fault)
