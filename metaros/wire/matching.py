"""Why two endpoints of one topic or service do not hear each other: ROS itself does not say when hashes differ."""

from __future__ import annotations

from typing import Final, NamedTuple

from metaros.errors import TypeHashError
from metaros.wire.qos import incompatibilities
from metaros.wire.tokens import EndpointKind, EndpointToken

__all__ = ["Obstacle", "obstacle"]

_COUNTERPART: Final[dict[EndpointKind, EndpointKind]] = {"MP": "MS", "MS": "MP", "SS": "SC", "SC": "SS"}


class Obstacle(NamedTuple):
    """What stands between two endpoints; `code` is stable, `silent` whether nothing at all gets through."""

    code: str
    text: str
    silent: bool


def obstacle(own: EndpointToken, peer: EndpointToken) -> Obstacle | None:
    """What keeps `own` and `peer` apart; None when they match, or were never meant to meet."""
    if own.topic != peer.topic or _COUNTERPART[own.kind] != peer.kind or own.node.domain != peer.node.domain:
        return None
    who = f"{peer.node.full_name} ({peer.kind})"
    if own.type_name != peer.type_name:
        return Obstacle("type_mismatch", f"{who} uses type {peer.type_name}, here it is {own.type_name}", True)
    if own.type_hash != peer.type_hash:
        hashes = f"{peer.type_hash}, here it is {own.type_hash}"
        return Obstacle(TypeHashError.code, f"{who} has another {own.type_name}: {hashes}", True)
    if own.kind in ("MP", "MS"):
        offered, requested = (own.qos, peer.qos) if own.kind == "MP" else (peer.qos, own.qos)
        reasons = incompatibilities(offered, requested)
        if reasons:
            return Obstacle("qos_mismatch", f"{who} has QoS that does not match: {'; '.join(reasons)}", False)
    return None
