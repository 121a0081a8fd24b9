"""Whether two endpoints of one topic or service match, and why not: ROS itself is silent where type hashes differ."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from metaros.errors import TypeHashError
from metaros.wire.liveliness_tokens import ENDPOINT_KINDS, EndpointKind, EndpointToken
from metaros.wire.names import NO_HASH
from metaros.wire.qos import Durability, QoSProfile, Reliability, incompatibilities

__all__ = ["Mismatch", "is_counterpart", "mismatch", "reading_qos"]

_COUNTERPART: Final[dict[EndpointKind, EndpointKind]] = {"MP": "MS", "MS": "MP", "SS": "SC", "SC": "SS"}


class Mismatch(NamedTuple):
    """Why two endpoints do not match.

    `code` is stable, `text` names the topic, both nodes and the policy, `silent` says whether nothing at all gets
    through, `policies` which of the QoS policies are at odds.
    """

    code: str
    text: str
    silent: bool
    policies: tuple[str, ...] = ()


def is_counterpart(own: EndpointToken, peer: EndpointToken) -> bool:
    """Whether the two are counterparts on one name, be they compatible or not."""
    return own.topic == peer.topic and _COUNTERPART[own.kind] == peer.kind and own.node.domain == peer.node.domain


def mismatch(own: EndpointToken, peer: EndpointToken) -> Mismatch | None:
    """What keeps `own` and `peer` apart; None when they match, or were never meant to meet."""
    if not is_counterpart(own, peer):
        return None
    where = f"{own.topic}: {_who(own)} and {_who(peer)}"
    if own.type_name != peer.type_name:
        return Mismatch("type_mismatch", f"{where}: type {own.type_name} here, {peer.type_name} there", True)
    if own.type_hash != peer.type_hash and NO_HASH not in (own.type_hash, peer.type_hash):  # Humble writes none
        hashes = f"{own.type_hash} here, {peer.type_hash} there"
        return Mismatch(TypeHashError.code, f"{where}: two definitions of {own.type_name}: {hashes}", True)
    if own.kind in ("MP", "MS"):
        offered, requested = (own.qos, peer.qos) if own.kind == "MP" else (peer.qos, own.qos)
        reasons = incompatibilities(offered, requested)
        if reasons:
            policies = tuple(dict.fromkeys(reason.partition(":")[0] for reason in reasons))
            return Mismatch("qos_mismatch", f"{where}: {'; '.join(reasons)}", False, policies)
    return None


def _who(token: EndpointToken) -> str:
    return f"{ENDPOINT_KINDS[token.kind]} {token.node.full_name}"


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
