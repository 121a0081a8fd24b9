"""`rclpy.lifecycle.publisher`: a publisher that is silent unless its node is active."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.lifecycle.managed_entity import SimpleManagedEntity
from metaros.ros2.rclpy.lifecycle.transitions import LifecycleState, TransitionCallbackReturn
from metaros.ros2.rclpy.logging.loggers import get_logger

__all__ = ["LifecyclePublisher"]


class LifecyclePublisher(SimpleManagedEntity, Publisher):
    """What is published while it is not activated goes nowhere: the node warns of the first message each time."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        SimpleManagedEntity.__init__(self)
        self._warned = False
        Publisher.__init__(self, *args, **kwargs)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish from now on."""
        self._warned = False
        return super().on_activate(state)

    def publish(self, msg: Any) -> None:
        """Send a message, or its bytes, or not."""
        if self._enabled:
            Publisher.publish(self, msg)
        elif not self._warned:
            self._warned = True
            logger = get_logger(self.logger_name)
            logger.warning(f"{self.topic_name}: not published, its lifecycle publisher is not activated")
