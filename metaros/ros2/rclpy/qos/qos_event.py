"""`rclpy.qos_event`: the name of `rclpy.event_handler` until Iron. Whoever takes something from here is told so."""

from __future__ import annotations

import warnings
from typing import Any

from metaros.ros2.rclpy.qos import event_handler

__all__: list[str] = []  # what there is is the other module's


def __getattr__(name: str) -> Any:
    if name not in event_handler.__all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("importing 'qos_event' is deprecated; import 'event_handler' instead", stacklevel=2)
    return getattr(event_handler, name)
