"""The tap: finds the topics of the agent's scope in the ROS graph and subscribes each once, as raw bytes."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Protocol

from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.ingress import Ingress
from edge_agent.forwarding.pipeline import Arrival
from edge_agent.forwarding.scope import ROSOUT, Scope
from edge_agent.forwarding.type_discovery import TypeDiscovery
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.idl import Catalogue
from metaros.node import Node
from metaros.wire import Durability, EndpointInfo, History, QoSProfile, Reliability

__all__ = ["Tap", "matching_qos"]

LOG = logging.getLogger("metaros.agent.tap")
SETTLE_S = 0.02  # tokens come in bursts when a node starts
KEEP_S = 30.0  # a topic without publishers stays subscribed so long: its node may only be restarting
DEPTH = 10
Topic = tuple[str, str, str]  # name, type, hash


class Closable(Protocol):
    """A subscription, as far as the tap cares."""

    def close(self) -> None:
        """Undeclare it."""


class Tap:
    """Keeps subscriptions in step with the graph. Everything but `route` runs on the event loop."""

    def __init__(
        self,
        node: Node,
        channels: Channels,
        scope: Scope,
        take: Callable[[list[Arrival], float], None],
        changed: Callable[[], None],
        clock: Clock,
        *,
        record: Callable[[list[Arrival]], None] | None = None,
    ) -> None:
        """`record` is called with every sample, on the draining thread, before any selection."""
        self._node = node
        self._channels = channels
        self._scope = scope
        self._changed = changed
        self._loop = asyncio.get_running_loop()
        self._clock = clock
        self._subscriptions: dict[Topic, Closable] = {}
        self._silent_since: dict[Topic, float] = {}
        self._routes: dict[str, Channel] = {}
        self._rosout_senders: dict[bytes, bool] = {}
        self._due: asyncio.TimerHandle | None = None
        self._closed = False
        self._urgent: set[Topic] = set()  # those whose samples never gather
        self._hurried = False  # a topic became urgent that is subscribed otherwise: then nothing gathers
        self._learner = TypeDiscovery(node, self._learned)
        self.ingress = Ingress(
            self.route,
            take,
            self._loop.call_soon_threadsafe,
            clock,
            record=record,
            watched=lambda: channels.watched or self._hurried,
        )
        channels.on_watched = self.ingress.hurry
        node.graph.on_change(self._on_change)
        self.reconcile()

    def route(self, key: str, gid: bytes) -> Channel | None:
        """The channel of a sample, on the draining thread; None for a foreign robot's log line."""
        topic = topic_of(key)
        channel = self._routes.get(topic)
        if channel is None:
            return None
        if channel.topic == ROSOUT:
            ours = self._rosout_senders.get(gid)
            if ours is None:
                self._rosout_senders = self._senders()
                ours = self._rosout_senders.get(gid, False)
            return channel if ours else None
        return channel

    def reconcile(self) -> None:
        """Announce what is new in the graph and subscribe what has a publisher."""
        self._due = None
        if self._closed:
            return
        publishers, subscribers = self._survey()
        before = self._channels.revision
        for topic in {**publishers, **dict.fromkeys(subscribers)}:
            endpoints = publishers.get(topic, [])
            keeps_all = any(keeps_everything(endpoint.qos) for endpoint in endpoints)
            qos = endpoints[0].qos_text if endpoints else ""
            channel = self._channels.observe(*topic, qos=qos, keeps_all=keeps_all)
            if channel is not None and endpoints:
                self._routes[f"{channel.topic[1:]}|{channel.type_hash}"] = channel  # another one once its class changed
                if topic not in self._subscriptions:
                    self._subscribe(topic, endpoints, urgent=channel.delivery == "event")
                elif channel.delivery == "event" and topic not in self._urgent:
                    self._hurried = True
            if channel is not None:
                self._learner.ask(channel, endpoints)
        for channel in self._channels:
            name = (channel.topic, channel.type_name, channel.type_hash)
            channel.publishers, channel.subscribers = len(publishers.get(name, ())), subscribers[name]
        self._rosout_senders = self._senders()
        self._forget_silent(publishers)
        if self._channels.revision != before:
            self._changed()

    def close(self) -> None:
        """Undeclare everything and stop the draining thread."""
        self._closed = True
        if self._due is not None:
            self._due.cancel()
        self._learner.close()
        for subscription in self._subscriptions.values():
            subscription.close()
        self.ingress.close()

    def _learned(self, channel: Channel, catalogue: Catalogue) -> None:
        """A node answered with its type: announce the channel anew."""
        self._channels.learn(channel, catalogue)
        self._changed()

    def _on_change(self, *_: object) -> None:
        """On a Zenoh thread: ask the loop to look again."""
        try:
            self._loop.call_soon_threadsafe(self._soon)
        except RuntimeError:  # the loop is closed: the program ends
            return

    def _soon(self) -> None:
        """Look again in a moment; the moment does not move while changes keep coming."""
        soon_s = self._loop.time() + SETTLE_S
        if self._closed or (self._due is not None and self._due.when() <= soon_s):
            return
        if self._due is not None:
            self._due.cancel()
        self._due = self._loop.call_at(soon_s, self.reconcile)

    def _survey(self) -> tuple[dict[Topic, list[EndpointInfo]], Counter[Topic]]:
        """Publishers of each topic in scope, and how many others subscribe it."""
        publishers: dict[Topic, list[EndpointInfo]] = {}
        subscribers: Counter[Topic] = Counter()
        own = (self._node.context.zid, self._node.full_name)
        for endpoint in self._node.graph.endpoints():
            if not self._scope.taps(endpoint.topic) or endpoint.kind not in ("MP", "MS"):
                continue
            name = (endpoint.topic, endpoint.type_name, endpoint.type_hash)
            if endpoint.kind == "MP":
                publishers.setdefault(name, []).append(endpoint)
            elif (endpoint.zid, endpoint.node_full_name) != own:
                subscribers[name] += 1
        return publishers, subscribers

    def _subscribe(self, topic: Topic, endpoints: list[EndpointInfo], *, urgent: bool) -> None:
        name, type_name, type_hash = topic
        sink = self.ingress.urgent_sink if urgent else self.ingress.sink
        try:
            qos = matching_qos([endpoint.qos for endpoint in endpoints])
            self._subscriptions[topic] = self._node.create_raw_subscription(name, type_name, type_hash, qos, sink)
            (self._urgent.add if urgent else self._urgent.discard)(topic)
        except MetarosError as error:
            LOG.warning("cannot tap %s: %s", name, error)

    def _forget_silent(self, publishers: Mapping[Topic, object]) -> None:
        """Undeclare subscriptions whose publishers are gone for good, so that dead topics leave the graph."""
        now_s = self._clock.monotonic_s()
        for topic in list(self._subscriptions):
            if topic in publishers:
                self._silent_since.pop(topic, None)
            elif now_s - self._silent_since.setdefault(topic, now_s) >= KEEP_S:
                del self._silent_since[topic]
                self._subscriptions.pop(topic).close()
        if self._silent_since and self._due is None:
            self._due = self._loop.call_later(KEEP_S, self.reconcile)

    def _senders(self) -> dict[bytes, bool]:
        """The GIDs of all log publishers, and whether their node is in scope."""
        return {
            endpoint.gid: self._scope.includes(endpoint.node_full_name)
            for endpoint in self._node.graph.endpoints(ROSOUT, "MP")
        }


def topic_of(key: str) -> str:
    """The part of a data key `<domain>/<name>/<type>/<hash>` that names a route: `name|hash`."""
    _domain, _, rest = key.partition("/")
    name, _type, type_hash = rest.rsplit("/", 2)
    return f"{name}|{type_hash}"


def keeps_everything(qos: QoSProfile) -> bool:
    """Whether the publisher asks that nothing be lost."""
    return qos.reliability == Reliability.RELIABLE and qos.history == History.KEEP_ALL


def matching_qos(offered: list[QoSProfile]) -> QoSProfile:
    """What matches every publisher: best effort and volatile, but more where all of them offer it and mean it."""
    lossless = all(keeps_everything(qos) for qos in offered)
    latched = all(qos.durability == Durability.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        reliability=Reliability.RELIABLE if lossless or latched else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
        history=History.KEEP_ALL if lossless else History.KEEP_LAST,
        depth=max(DEPTH, *(qos.depth for qos in offered)),
    )
