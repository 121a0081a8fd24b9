"""What the graph knows of a topic, the broker's own endpoints left out."""

from __future__ import annotations

from collections.abc import Iterable

from metaros.idl import default_catalogue, type_hash
from metaros.node import Node
from metaros.wire import NO_HASH, Durability, EndpointInfo, QoSProfile, Reliability

__all__ = ["is_sound", "others", "reading_qos", "sound_types"]


def others(node: Node, topic: str | None = None) -> list[EndpointInfo]:
    """Publishers and subscriptions of other nodes."""
    own = node.context.zid, node.full_name
    return [
        item
        for item in node.graph.endpoints(topic)
        if item.kind in ("MP", "MS") and (item.zid, item.node_full_name) != own
    ]


def sound_types(ends: Iterable[EndpointInfo]) -> list[str]:
    """The types of these endpoints that the catalogue knows so, what subscriptions ask for first."""
    ranked = sorted(ends, key=lambda item: (item.kind != "MS", item.type_name))
    return list(dict.fromkeys(item.type_name for item in ranked if is_sound(item)))


def is_sound(item: EndpointInfo) -> bool:
    """Whether the catalogue has the type as this endpoint has it."""
    if item.type_name not in default_catalogue():
        return False
    return item.type_hash in (NO_HASH, type_hash(item.type_name))


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
