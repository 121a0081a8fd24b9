"""Endpoint monitors: one for each endpoint, which turns graph changes into counts, events and warnings."""

from __future__ import annotations

import threading
from collections.abc import Callable

from metaros.executor import Spinnable
from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.dispatcher import EventDispatcher
from metaros.node.events.event_types import Event, Matched, QoSIncompatible
from metaros.node.events.peers import Peer, Peers
from metaros.wire.liveliness_tokens import EndpointToken

__all__ = ["EndpointMonitor"]


class EndpointMonitor:
    """Tracks the peers of an endpoint. Thread-safe. `warn_once(about, text)` gets what no callback takes."""

    def __init__(
        self,
        node: Spinnable,
        token: EndpointToken,
        callbacks: PublisherEvents | SubscriptionEvents | None = None,
        *,
        warn_once: Callable[[bytes, str], object],
    ) -> None:
        self._lock = threading.Lock()
        self._closed = False
        self._peers = Peers(token)
        self._dispatcher = EventDispatcher(node, token.topic, callbacks)
        self._warn_once = warn_once

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
            handled = self._dispatcher.send(_kind(event), event)
            self._peer_came(peer)
        if peer.mismatch is not None and not handled:
            self._warn_once(token.gid, f"{peer.mismatch.code}: {peer.mismatch.text}")

    def went(self, token: EndpointToken) -> None:
        """A token left the graph."""
        with self._lock:
            found = self._peers.discard(token)
            if found is None:
                return
            peer, event = found
            if event is not None:
                self._dispatcher.send(_kind(event), event)
            self._peer_went(peer)

    def known(self) -> list[EndpointToken]:
        """The peers that are taken to be in the graph."""
        with self._lock:
            return self._peers.tokens()

    def close(self) -> None:
        """Tell nothing more."""
        with self._lock:
            self._closed = True
        self._dispatcher.close()

    def _peer_came(self, peer: Peer) -> None:
        """For those who watch more than tokens; the lock is held."""

    def _peer_went(self, peer: Peer) -> None:
        """As `_peer_came`."""


def _kind(event: Event) -> str:
    if isinstance(event, Matched):
        return "matched"
    return "incompatible_qos" if isinstance(event, QoSIncompatible) else "type_hash_mismatch"
