"""Where each module of rclpy is in this package: `rclpy.qos` is `metaros.ros2.rclpy.qos.profile`."""

from __future__ import annotations

from typing import Final

__all__ = ["HOMES"]

HOMES: Final[dict[str, str]] = {}
