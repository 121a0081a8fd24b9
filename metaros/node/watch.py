"""Looks for peers that a node's endpoints will never hear, and has it said once."""

from __future__ import annotations

import threading

from metaros.node.endpoint import Endpoint
from metaros.wire import Graph
from metaros.wire.graph import Token
from metaros.wire.matching import obstacle
from metaros.wire.tokens import EndpointToken

__all__ = ["Watch"]


class Watch:
    """The endpoints of a context, compared with every endpoint that comes to the graph. Thread-safe."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._lock = threading.Lock()
        self._own: dict[str, list[Endpoint]] = {}
        graph.on_token(self._on_token)

    def add(self, endpoint: Endpoint) -> None:
        """Compare a new endpoint with who is there, and later with who comes."""
        with self._lock:
            self._own.setdefault(endpoint.topic, []).append(endpoint)
        for token in self._graph.tokens():
            self._compare(endpoint, token)

    def discard(self, endpoint: Endpoint) -> None:
        """The reverse of `add`."""
        with self._lock:
            rest = [other for other in self._own.pop(endpoint.topic, []) if other is not endpoint]
            if rest:
                self._own[endpoint.topic] = rest

    def _on_token(self, token: Token, alive: bool) -> None:
        if not alive or not isinstance(token, EndpointToken):
            return
        with self._lock:
            endpoints = list(self._own.get(token.topic, ()))
        for endpoint in endpoints:
            self._compare(endpoint, token)

    def _compare(self, endpoint: Endpoint, peer: EndpointToken) -> None:
        found = obstacle(endpoint.token, peer)
        if found is not None and endpoint.report_once(peer.gid, f"{found.code}: {found.text}") and found.silent:
            endpoint.mismatched += 1
