"""A node as a class: the launcher makes it and spins it."""

from __future__ import annotations

import metaros
from metaros.interfaces.std_msgs.msg import Float64


class Consumer(metaros.Node):
    """Says how far it is to the obstacle."""

    def __init__(self) -> None:
        super().__init__("consumer")
        self.heard = 0
        self.create_subscription(Float64, "distance", self.on_distance, 10)

    def on_distance(self, message: Float64) -> None:
        self.heard += 1
        if self.heard % 5 == 1:
            self.get_logger().info(f"{message.data:.1f} m to the obstacle")
