"""The peers of one endpoint: who matches, who does not and why. Pure: tokens in, events out."""

from __future__ import annotations

from typing import NamedTuple

from metaros.node.events.event_types import Event, Matched, QoSIncompatible, TypeMismatch
from metaros.wire.liveliness_tokens import EndpointToken
from metaros.wire.matching import Mismatch, is_counterpart, mismatch

__all__ = ["Peer", "Peers"]


class Peer(NamedTuple):
    """A counterpart on our topic, and the mismatch, if any."""

    token: EndpointToken
    mismatch: Mismatch | None


class Peers:
    """All counterparts on our topic. A peer that comes back counts again in the totals."""

    def __init__(self, own: EndpointToken) -> None:
        self.matched = 0  # now
        self.matched_total = 0
        self.incompatible_total = 0
        self.mismatched_total = 0
        self._own = own
        self._peers: dict[EndpointToken, Peer] = {}
        self._nodes: dict[bytes, str] = {}

    def add(self, token: EndpointToken) -> tuple[Peer, Event] | None:
        """A token appeared; None when it is no counterpart of ours, or known."""
        if token in self._peers or not is_counterpart(self._own, token):
            return None
        peer = self._peers[token] = Peer(token, mismatch(self._own, token))
        self._nodes[token.gid] = token.node.full_name
        return peer, self._came(peer)

    def discard(self, token: EndpointToken) -> tuple[Peer, Event | None] | None:
        """A token went; None when it was not known. Only who matched is worth an event."""
        peer = self._peers.pop(token, None)
        if peer is None:
            return None
        self._nodes.pop(token.gid, None)
        if peer.mismatch is not None:
            return peer, None
        self.matched -= 1
        return peer, self._matched(token, 0, -1)

    def tokens(self) -> list[EndpointToken]:
        """All peers."""
        return list(self._peers)

    def node_of(self, gid: bytes) -> str:
        """The name of the node behind a GID; empty when it is not in the graph."""
        return self._nodes.get(gid, "")

    def _came(self, peer: Peer) -> Event:
        token, found = peer
        if found is None:
            self.matched += 1
            self.matched_total += 1
            return self._matched(token, 1, 1)
        topic, node = self._own.topic, token.node.full_name
        if not found.silent:
            self.incompatible_total += 1
            total, policies = self.incompatible_total, found.policies
            return QoSIncompatible(topic=topic, node=node, total=total, change=1, policies=policies, reason=found.text)
        self.mismatched_total += 1
        return TypeMismatch(
            topic=topic,
            node=node,
            total=self.mismatched_total,
            change=1,
            type_name=self._own.type_name,
            type_hash=self._own.type_hash,
            peer_type_name=token.type_name,
            peer_type_hash=token.type_hash,
        )

    def _matched(self, token: EndpointToken, change: int, current_change: int) -> Matched:
        return Matched(
            topic=self._own.topic,
            node=token.node.full_name,
            total=self.matched_total,
            change=change,
            current=self.matched,
            current_change=current_change,
        )
