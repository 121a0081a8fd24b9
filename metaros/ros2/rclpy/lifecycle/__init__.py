"""`rclpy.lifecycle`: nodes with a lifecycle, and what goes with their states."""

from __future__ import annotations

from metaros.ros2.rclpy.lifecycle.managed_entity import ManagedEntity, SimpleManagedEntity
from metaros.ros2.rclpy.lifecycle.node import LifecycleNode, LifecycleNodeMixin
from metaros.ros2.rclpy.lifecycle.publisher import LifecyclePublisher
from metaros.ros2.rclpy.lifecycle.transitions import LifecycleState, TransitionCallbackReturn

__all__ = [
    "LifecycleMixin",
    "LifecycleNode",
    "LifecycleNodeMixin",
    "LifecyclePublisher",
    "LifecycleState",
    "ManagedEntity",
    "Node",
    "Publisher",
    "SimpleManagedEntity",
    "State",
    "TransitionCallbackReturn",
]

# The second names of rclpy: `from rclpy.lifecycle import Node, Publisher, State`.
LifecycleMixin = LifecycleNodeMixin
Node = LifecycleNode
Publisher = LifecyclePublisher
State = LifecycleState
