"""Observers: one for each endpoint, which turns what happens to it into counts, events and warnings."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.kinds import Event, Matched, QoSIncompatible
from metaros.node.events.peers import Peer, Peers
from metaros.node.events.post import Post
from metaros.wire.tokens import EndpointToken

if TYPE_CHECKING:
    from metaros.node.endpoint import Endpoint

__all__ = ["Observer"]


class Observer:
    """Who is on the other side of an endpoint. Thread-safe."""

    def __init__(self, endpoint: Endpoint, callbacks: PublisherEvents | SubscriptionEvents | None = None) -> None:
        self._endpoint = endpoint
        self._lock = threading.Lock()
        self._closed = False
        self._peers = Peers(endpoint.token)
        self._post = Post(endpoint.node, endpoint.topic, callbacks)

    # -- counts ----------------------------------------------------------------------------------------------------

    @property
    def matched(self) -> int:
        """Peers that match now."""
        return self._peers.matched

    @property
    def incompatible_qos(self) -> int:
        """Peers that ever came with QoS that does not fit."""
        return self._peers.incompatible_total

    @property
    def type_hash_mismatch(self) -> int:
        """Peers that ever came with another type or another definition of it."""
        return self._peers.mismatched_total

    # -- peers -----------------------------------------------------------------------------------------------------

    def came(self, token: EndpointToken) -> None:
        """A token is in the graph."""
        with self._lock:
            found = None if self._closed else self._peers.add(token)
            if found is None:
                return
            peer, event = found
            told = self._post.send(_kind(event), event)
            self._peer_came(peer)
        if peer.obstacle is not None and not told:
            self._endpoint.warn_once(token.gid, f"{peer.obstacle.code}: {peer.obstacle.text}")

    def went(self, token: EndpointToken) -> None:
        """A token left the graph."""
        with self._lock:
            found = self._peers.discard(token)
            if found is None:
                return
            peer, event = found
            if event is not None:
                self._post.send(_kind(event), event)
            self._peer_went(peer)

    def known(self) -> list[EndpointToken]:
        """The peers that are taken to be in the graph."""
        with self._lock:
            return self._peers.tokens()

    def close(self) -> None:
        """Tell nothing more."""
        with self._lock:
            self._closed = True
        self._post.close()

    def _peer_came(self, peer: Peer) -> None:
        """For those who watch more than tokens; the lock is held."""

    def _peer_went(self, peer: Peer) -> None:
        """As `_peer_came`."""


def _kind(event: Event) -> str:
    if isinstance(event, Matched):
        return "matched"
    return "incompatible_qos" if isinstance(event, QoSIncompatible) else "type_hash_mismatch"
