"""What the graph knows of a topic, the broker's own endpoints left out."""

from __future__ import annotations

from metaros.node import Node
from metaros.wire import EndpointInfo

__all__ = ["others"]


def others(node: Node, topic: str | None = None) -> list[EndpointInfo]:
    """Publishers and subscriptions of other nodes."""
    own = node.context.zid, node.full_name
    return [
        item
        for item in node.graph.endpoints(topic)
        if item.kind in ("MP", "MS") and (item.zid, item.node_full_name) != own
    ]
