"""`rclpy.qos_event`: the name of `rclpy.event_handler` until Iron."""

from __future__ import annotations

import warnings

from metaros.ros2.rclpy.qos import event_handler
from metaros.ros2.rclpy.qos.event_handler import *  # noqa: F403

__all__ = list(event_handler.__all__)

warnings.warn("importing 'qos_event' is deprecated; import 'event_handler' instead", stacklevel=2)
