"""Notifies the endpoints of a context when peers on their topics appear or disappear."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol

from metaros.wire import Graph
from metaros.wire.graph import Token
from metaros.wire.liveliness_tokens import EndpointToken
from metaros.wire.names import NO_HASH

__all__ = ["Observer", "Watch"]


class Observer(Protocol):
    """Who is told of peers on a topic."""

    def came(self, token: EndpointToken) -> None:
        """A token is in the graph."""

    def went(self, token: EndpointToken) -> None:
        """A token left the graph."""

    def known(self) -> list[EndpointToken]:
        """The peers that are taken to be in the graph."""


class Watch:
    """The observers of a context's endpoints, by topic. Thread-safe. `zid` is the context's own session."""

    def __init__(self, graph: Graph, zid: str) -> None:
        self._graph = graph
        self._zid = zid
        self._lock = threading.Lock()
        self._monitors: dict[str, list[Observer]] = {}
        self._kinds: set[bool] = set()  # of others' endpoints that were ever there: whether they write type hashes
        self._waiting: dict[Callable[[], None], bool] = {}
        graph.on_token(self._on_token)
        for token in graph.tokens():
            self._note_kind(token)

    def when(self, callback: Callable[[], None], *, hashes: bool) -> Callable[[], None]:
        """Call `callback()` once there is another's endpoint that writes type hashes, or none; perhaps at once.

        Returns how to stop that.
        """
        with self._lock:
            there = hashes in self._kinds
            if not there:
                self._waiting[callback] = hashes
        if there:
            callback()
        return lambda: self._stop_waiting(callback)

    def _stop_waiting(self, callback: Callable[[], None]) -> None:
        with self._lock:
            self._waiting.pop(callback, None)

    def _note_kind(self, token: EndpointToken) -> None:
        kind = token.type_hash != NO_HASH
        if kind in self._kinds or token.node.zid == self._zid:
            return
        with self._lock:
            self._kinds.add(kind)
            due = [callback for callback, wanted in self._waiting.items() if wanted is kind]
            for callback in due:
                del self._waiting[callback]
        for callback in due:
            callback()

    def add(self, topic: str, observer: Observer) -> None:
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

    def discard(self, topic: str, observer: Observer) -> None:
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
        if alive:
            self._note_kind(token)
        with self._lock:
            observers = list(self._monitors.get(token.topic, ()))
        for observer in observers:
            if alive:
                observer.came(token)
            else:
                observer.went(token)
