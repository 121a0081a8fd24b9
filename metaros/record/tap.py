"""Finds the topics to record in the graph and subscribes each once, as raw bytes; later ones join as they appear.

Samples are taken from the first moment. The schema is looked for beside that, on a thread of its own, because a node
may have to be asked for it.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Final

from metaros.errors import MetarosError
from metaros.limits import LIMITS
from metaros.node import Node, RawSubscription
from metaros.record.sample_queue import Route, SampleQueue
from metaros.record.schemas import find_schema, known_schema
from metaros.record.selection import TopicSelection
from metaros.wire import Durability, EndpointInfo, QoSProfile, Reliability

__all__ = ["Tap"]

_log = logging.getLogger("metaros.record")
_SETTLE_S: Final = 0.01  # tokens come in bursts when a node starts
_DEPTH: Final = 1000
Topic = tuple[str, str, str]  # name, type, hash


class Tap:
    """Keeps subscriptions in step with the graph. `ready(route)` is called when a route's schema is settled."""

    def __init__(
        self,
        node: Node,
        selection: TopicSelection,
        samples: SampleQueue,
        *,
        ready: Callable[[Route], object],
        notice: Callable[[str], object],
    ) -> None:
        self.routes: dict[Topic, Route] = {}
        self._node, self._selection, self._queue = node, selection, samples
        self._ready, self._notice = ready, notice
        self._subscriptions: list[RawSubscription] = []
        self._unsettled: SimpleQueue[Route | None] = SimpleQueue()
        self._changed, self._closed = threading.Event(), False
        self._full_reported = False
        self._forget = node.graph.on_change(self._changed.set)
        self._threads = [
            threading.Thread(target=self._watch, name="metaros-record-tap", daemon=True),
            threading.Thread(target=self._settle, name="metaros-record-schemas", daemon=True),
        ]
        self._reconcile()
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Undeclare everything; nothing is put into the intake after that."""
        self._closed = True
        self._forget()
        self._changed.set()
        self._unsettled.put(None)
        self._threads[0].join()
        for subscription in self._subscriptions:
            subscription.close()
        self._threads[1].join()

    def _watch(self) -> None:
        pause = threading.Event()
        while not self._closed:
            self._changed.wait()
            self._changed.clear()
            if not self._closed:
                pause.wait(_SETTLE_S)
                self._reconcile()

    def _reconcile(self) -> None:
        """Subscribe what has a publisher and is wanted."""
        offers: dict[Topic, list[EndpointInfo]] = {}
        for endpoint in self._node.graph.endpoints(kind="MP"):
            if self._selection.takes(endpoint.topic):
                offers.setdefault((endpoint.topic, endpoint.type_name, endpoint.type_hash), []).append(endpoint)
        for topic, publishers in offers.items():
            route = self.routes.get(topic)
            if route is not None:
                route.qos = _union(route.qos, publishers)
            elif len(self.routes) < LIMITS.channels_per_robot:
                self._join(topic, publishers)
            elif not self._full_reported:
                self._full_reported = True
                self._notice(f"more than {LIMITS.channels_per_robot} topics: further ones are not recorded")

    def _join(self, topic: Topic, publishers: list[EndpointInfo]) -> None:
        name, type_name, type_hash = topic
        route = Route(name, type_name, type_hash, qos=_union([], publishers))
        route.schema = known_schema(type_name, type_hash) or None
        self.routes[topic] = route
        try:
            subscription = self._node.create_raw_subscription(
                name, type_name, type_hash, _matching(publishers), self._queue.sink(route)
            )
        except MetarosError as error:
            self._notice(f"cannot record {name}: {error}")
            return
        self._subscriptions.append(subscription)
        if route.schema is None:
            self._unsettled.put(route)

    def _settle(self) -> None:
        """Ask for the schemas that the catalogue does not have, one after the other."""
        while (route := self._unsettled.get()) is not None:
            text, reason = "", "the recording ends"
            try:
                if not self._closed:
                    text, reason = find_schema(self._node, route.type_name, route.type_hash)
            except Exception as error:  # a peer's answer must not end the recording
                _log.exception("the schema of %s", route.type_name)
                reason = str(error)
            route.schema = text
            if not text:
                self._notice(f"no schema for {route.type_name} of {route.topic}, recorded without one: {reason}")
            self._ready(route)


def _union(known: list[QoSProfile], publishers: list[EndpointInfo]) -> list[QoSProfile]:
    """The distinct offers so far."""
    return list(dict.fromkeys([*known, *(end.qos.resolved() for end in publishers)]))


def _matching(publishers: list[EndpointInfo]) -> QoSProfile:
    """What every publisher's offer satisfies; kept samples where all keep them."""
    offers = [end.qos for end in publishers]
    latched = all(qos.durability is Durability.TRANSIENT_LOCAL for qos in offers)
    reliable = all(qos.reliability is not Reliability.BEST_EFFORT for qos in offers)
    return QoSProfile(
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
        depth=max(qos.depth for qos in offers) if latched else _DEPTH,
    )
