"""Notifies the endpoints of a context when peers on their topics appear or disappear."""

from __future__ import annotations

import threading

from metaros.node.events.endpoint_monitor import EndpointMonitor
from metaros.wire import Graph
from metaros.wire.graph import Token
from metaros.wire.liveliness_tokens import EndpointToken

__all__ = ["Watch"]


class Watch:
    """The monitors of a context's endpoints, by topic. Thread-safe."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._lock = threading.Lock()
        self._monitors: dict[str, list[EndpointMonitor]] = {}
        graph.on_token(self._on_token)

    def add(self, topic: str, observer: EndpointMonitor) -> None:
        """Tell a new endpoint's observer who is there, and later who comes and goes."""
        with self._lock:
            self._monitors.setdefault(topic, []).append(observer)
        for token in self._tokens(topic):
            observer.came(token)
        known = observer.known()
        there = set(self._tokens(topic)) if known else set()
        for token in known:  # who left while we told of it: that news came first, and meant nothing yet
            if token not in there:
                observer.went(token)

    def discard(self, topic: str, observer: EndpointMonitor) -> None:
        """The reverse of `add`."""
        with self._lock:
            rest = [other for other in self._monitors.pop(topic, []) if other is not observer]
            if rest:
                self._monitors[topic] = rest

    def _tokens(self, topic: str) -> list[EndpointToken]:
        return self._graph.tokens(topic)

    def _on_token(self, token: Token, alive: bool) -> None:
        if not isinstance(token, EndpointToken):
            return
        with self._lock:
            observers = list(self._monitors.get(token.topic, ()))
        for observer in observers:
            if alive:
                observer.came(token)
            else:
                observer.went(token)
