"""`rclpy.validate_node_name`."""

from __future__ import annotations

from metaros.ros2.rclpy.names.exceptions import InvalidNodeNameException
from metaros.ros2.rclpy.names.grammar import find_node_name_fault

__all__ = ["validate_node_name"]


def validate_node_name(node_name: str) -> bool:
    """True for a node's name; InvalidNodeNameException says what is wrong with any other."""
    fault = find_node_name_fault(node_name)
    if fault is not None:
        raise InvalidNodeNameException(node_name, *fault)
    return True
