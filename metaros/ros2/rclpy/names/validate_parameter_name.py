"""`rclpy.validate_parameter_name`."""

from __future__ import annotations

from metaros.ros2.rclpy.names.exceptions import InvalidParameterException

__all__ = ["validate_parameter_name"]


def validate_parameter_name(name: str) -> bool:
    """True for any text that is not empty, as in rclpy; InvalidParameterException otherwise."""
    if not name:
        raise InvalidParameterException(name)
    return True
