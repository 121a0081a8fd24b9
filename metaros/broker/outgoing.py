"""ROS topics on their way to ZeroMQ subscribers: subscribed only while somebody there wants them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import zenoh

from metaros.broker.demand import Demand
from metaros.broker.faults import Faults
from metaros.broker.report import Direction, TopicRow
from metaros.broker.topics import others
from metaros.broker.types import Types
from metaros.broker.v1_json import to_payload
from metaros.cdr import codec
from metaros.concurrency.backlog import Backlog
from metaros.errors import AttachmentError, MetarosError
from metaros.idl.globs import Glob
from metaros.limits import LIMITS
from metaros.node import Node, RawSubscription
from metaros.wire import EndpointInfo, parse_attachment
from metaros.wire.matching import reading_qos

__all__ = ["Outgoing"]

_log = logging.getLogger("metaros.broker")
_OVERHEAD_BYTES = 512  # what a waiting sample weighs beside its payload
Item = tuple[zenoh.Sample, Callable[[bytes], Any]]


class _Tap:
    """One topic: its subscriptions, one for each type of its publishers, and what came through them."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.type_name = ""
        self.subscriptions: dict[tuple[str, str], RawSubscription] = {}
        self.backlog: Backlog[Item] = Backlog()
        self.spellings: tuple[bytes, ...] = ()
        self.held: Item | None = None  # the newest that came while its subscribers were away for a moment
        self.messages = self.bytes = self.bridged = self.malformed = 0

    def row(self) -> TopicRow:
        return TopicRow(
            topic=self.topic,
            direction=Direction.TO_ZMQ,
            type=self.type_name,
            messages=self.messages,
            bytes=self.bytes,
            bridged=self.bridged,
            dropped=self.backlog.dropped,
            malformed=self.malformed,
            heard=bool(self.spellings),
        )


class Outgoing:
    """The taps. It belongs to the bridge's thread; samples come in on Zenoh's, the counters may be read from any."""

    def __init__(
        self,
        node: Node,
        demand: Demand,
        *,
        types: Types,
        only: Sequence[Glob],
        strict: bool,
        is_own: Callable[[str, bytes], bool],
        send: Callable[[bytes, bytes], None],
        wake: Callable[[], None],
        faults: Faults,
    ) -> None:
        self._node = node
        self._demand = demand
        self._types = types
        self._only = only
        self._strict = strict
        self._is_own = is_own
        self._send = send
        self._wake = wake
        self._faults = faults
        self._taps: dict[str, _Tap] = {}
        self._published: dict[str, list[EndpointInfo]] = {}

    def look(self) -> None:
        """The graph has changed: see who publishes. `refresh` acts on it."""
        self._published = {}
        for item in others(self._node):
            if item.kind == "MP" and self._allowed(item.topic):
                self._published.setdefault(item.topic, []).append(item)

    def refresh(self) -> None:
        """The demand or the graph has changed: subscribe to what is wanted and published, leave the rest."""
        for topic, publishers in self._published.items():
            if self._demand.wanted(topic):
                self._open(topic, publishers)
        for tap in self._taps.values():
            tap.spellings = self._demand.spellings(tap.topic)
            if not (tap.topic in self._published and self._demand.wanted(tap.topic)):
                _close(tap)
            elif tap.spellings and tap.held is not None:
                held, tap.held = tap.held, None
                self._forward(tap, held)

    def work(self, time_s: float) -> bool:
        """Forward samples for about so long, one of each topic in turn; whether more wait."""
        now_s = self._node.clock.monotonic_s
        until_s = now_s() + time_s
        busy = [tap for tap in self._taps.values() if len(tap.backlog)]
        while busy and now_s() < until_s:
            for tap in busy:
                item = tap.backlog.take()
                if item is not None:
                    self._take(tap, item)
            busy = [tap for tap in busy if len(tap.backlog)]
        return bool(busy)

    def rows(self) -> list[TopicRow]:
        """For the report."""
        return [tap.row() for tap in list(self._taps.values())]

    def close(self) -> None:
        """Leave every topic."""
        for tap in self._taps.values():
            _close(tap)

    def _allowed(self, topic: str) -> bool:
        return not self._only or any(glob.matches(topic) for glob in self._only)

    def _open(self, topic: str, publishers: list[EndpointInfo]) -> None:
        tap = self._taps.get(topic)
        if tap is None:
            if len(self._taps) >= LIMITS.broker_topics:
                self._faults.warn_once("taps", f"more than {LIMITS.broker_topics} topics: {topic} is not bridged")
                return
            tap = self._taps[topic] = _Tap(topic)
        for item in publishers:
            kind = item.type_name, item.type_hash
            if kind in tap.subscriptions:
                continue
            cls = self._types.find(item)
            if cls is None:
                continue
            tap.type_name = item.type_name
            sink = partial(self._sink, tap, codec(cls).decode)
            qos = reading_qos(other.qos for other in publishers)
            tap.subscriptions[kind] = self._node.create_raw_subscription(topic, *kind, qos, sink)

    def _sink(self, tap: _Tap, decode: Callable[[bytes], Any], sample: zenoh.Sample) -> None:
        """On a Zenoh thread, or on the bridge's own: never on the main thread, where a signal could be lost here."""
        tap.backlog.put((sample, decode), len(sample.payload) + _OVERHEAD_BYTES)
        self._wake()

    def _take(self, tap: _Tap, item: Item) -> None:
        sample = item[0]
        tap.messages += 1
        tap.bytes += len(sample.payload)
        if tap.spellings:
            self._forward(tap, item)
        else:
            tap.held = item

    def _forward(self, tap: _Tap, item: Item) -> None:
        sample, decode = item
        try:
            if sample.attachment is None:
                raise AttachmentError("a sample without an attachment")
            seq, _, gid = parse_attachment(sample.attachment.to_bytes())
            if self._is_own(tap.topic, gid):
                tap.messages -= 1
                tap.bytes -= len(sample.payload)
                return
            payload = to_payload(decode(sample.payload.to_bytes()), seq=seq, strict=self._strict)
        except MetarosError as error:
            tap.malformed += 1
            self._faults.warn_once((tap.topic, "ros", error.code), f"{tap.topic}, to ZeroMQ: {error}")
            return
        except Exception:  # a fault of ours: one topic's, not the bridge's
            tap.malformed += 1
            if self._node.first_report(("zmq fault out", tap.topic)):
                _log.exception("%s: a sample could not be bridged", tap.topic)
            return
        for spelling in tap.spellings:
            self._send(spelling, payload)
        tap.bridged += 1


def _close(tap: _Tap) -> None:
    for subscription in tap.subscriptions.values():
        subscription.close()
    tap.subscriptions.clear()
    tap.backlog.clear()
    tap.held = None
