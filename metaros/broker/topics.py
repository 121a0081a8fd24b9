"""What the graph knows of a topic, the broker's own endpoints left out."""

from __future__ import annotations

from collections.abc import Iterable

from metaros.node import Node
from metaros.wire import Durability, EndpointInfo, QoSProfile, Reliability

__all__ = ["others", "reading_qos"]


def others(node: Node, topic: str | None = None) -> list[EndpointInfo]:
    """Publishers and subscriptions of other nodes."""
    own = node.context.zid, node.full_name
    return [
        item
        for item in node.graph.endpoints(topic)
        if item.kind in ("MP", "MS") and (item.zid, item.node_full_name) != own
    ]


def reading_qos(offered: Iterable[QoSProfile]) -> QoSProfile:
    """What suits all publishers: best effort unless all are reliable, old samples where all keep them."""
    profiles = list(offered)
    reliable = all(qos.reliability is Reliability.RELIABLE for qos in profiles)
    kept = bool(profiles) and all(qos.durability is Durability.TRANSIENT_LOCAL for qos in profiles)
    return QoSProfile(
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if kept else Durability.VOLATILE,
        depth=100,
    )
