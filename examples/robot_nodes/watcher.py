"""Hears what happens to the nodes of a launcher."""

from __future__ import annotations

import metaros
from metaros.interfaces.metaros_msgs.msg import NodeEvent


class Watcher(metaros.Node):
    """Says it again."""

    def __init__(self) -> None:
        super().__init__("watcher")
        qos = metaros.QoSProfile(depth=64, durability=metaros.Durability.TRANSIENT_LOCAL)
        self.create_subscription(NodeEvent, "/metaros/node_events", self.on_event, qos)

    def on_event(self, event: NodeEvent) -> None:
        if event.kind == "node_restarted":
            self.get_logger().info(f"{event.node} was restarted, time {event.restarts}")
        elif event.kind in ("quarantined", "safe_stop"):
            self.get_logger().error(f"{event.node}: {event.kind}: {event.reason}")
