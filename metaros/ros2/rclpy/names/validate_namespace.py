"""`rclpy.validate_namespace`."""

from __future__ import annotations

from metaros.ros2.rclpy.names.exceptions import InvalidNamespaceException
from metaros.ros2.rclpy.names.grammar import find_namespace_fault

__all__ = ["validate_namespace"]


def validate_namespace(namespace: str) -> bool:
    """True for a namespace; InvalidNamespaceException says what is wrong with any other."""
    fault = find_namespace_fault(namespace)
    if fault is not None:
        raise InvalidNamespaceException(namespace, *fault)
    return True
