"""Where each module of rclpy is in this package: `rclpy.qos` is `metaros.ros2.rclpy.qos.profile`."""

from __future__ import annotations

from typing import Final

__all__ = ["HOMES"]

HOMES: Final[dict[str, str]] = {
    "client": "core.client",
    "context": "core.context",
    "destroyable": "core.destroyable",
    "handle": "core.handle",
    "impl": "core.impl",
    "impl.implementation_singleton": "core.implementation_singleton",
    "node": "core.node",
    "publisher": "core.publisher",
    "service": "core.service",
    "service_introspection": "core.service_introspection",
    "signals": "core.signals",
    "subscription": "core.subscription",
    "utilities": "core.utilities",
    "wait_for_message": "core.wait_for_message",
}
