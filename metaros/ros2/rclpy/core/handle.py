"""`rclpy.handle`: the error of a handle that is gone."""

from __future__ import annotations

from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle

__all__ = ["InvalidHandle"]
