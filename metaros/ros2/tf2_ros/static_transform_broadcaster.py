"""Telling transforms that hold for good."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.qos.profile import DurabilityPolicy, HistoryPolicy, QoSProfile
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import pose_of, time_ns, transform_stamped
from metaros.ros2.tf2_ros.transform_broadcaster import as_list

__all__ = ["StaticTransformBroadcaster"]


class StaticTransformBroadcaster:
    """Publishes on `/tf_static`, where the last message is kept for who comes later.

    Therefore each message has all transforms that were sent so far, of each child frame the newest.
    """

    def __init__(self, node: Any, qos: Any = None) -> None:
        if qos is None:
            qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, history=HistoryPolicy.KEEP_LAST)
        self.pub_tf = node.create_publisher(interface("tf2_msgs/msg/TFMessage"), "/tf_static", qos)
        self._sent: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:
        """Send a `TransformStamped`, or several. They are copied: the caller may use them again."""
        for one in as_list(transform):
            header = one.header
            self._sent[one.child_frame_id] = transform_stamped(
                header.frame_id, one.child_frame_id, time_ns(header.stamp), pose_of(one.transform)
            )
        self.pub_tf.publish(interface("tf2_msgs/msg/TFMessage")(transforms=list(self._sent.values())))
