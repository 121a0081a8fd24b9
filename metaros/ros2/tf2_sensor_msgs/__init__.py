"""`tf2_sensor_msgs`: point clouds from frame to frame."""

from __future__ import annotations

from metaros.ros2.tf2_sensor_msgs.tf2_sensor_msgs import (
    do_transform_cloud,
    from_msg_msg,
    to_msg_msg,
    transform_points,
)

__all__ = ["do_transform_cloud", "from_msg_msg", "to_msg_msg", "transform_points"]
