"""Telling transforms that change."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["TransformBroadcaster", "as_list"]


class TransformBroadcaster:
    """Publishes on `/tf`; `qos` is a profile or a depth, 100 by default."""

    def __init__(self, node: Any, qos: Any = None) -> None:
        self.pub_tf = node.create_publisher(
            interface("tf2_msgs/msg/TFMessage"), "/tf", QoSProfile(depth=100) if qos is None else qos
        )

    def sendTransform(self, transform: Any) -> None:
        """Send a `TransformStamped`, or several."""
        self.pub_tf.publish(interface("tf2_msgs/msg/TFMessage")(transforms=as_list(transform)))


def as_list(transform: Any) -> list[Any]:
    """One transform or several, as a list."""
    return list(transform) if isinstance(transform, Iterable) else [transform]
