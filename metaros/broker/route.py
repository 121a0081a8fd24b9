"""One ZeroMQ topic on its way to ROS: its type, its publisher, its counters."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Literal

import zenoh

from metaros.broker.faults import Faults
from metaros.broker.frames import parse_payload
from metaros.broker.raw_payload import raw_data
from metaros.broker.report import Direction, TopicRow
from metaros.broker.topics import others
from metaros.broker.type_inference import TYPE_MARKER, TypeTable, infer_type
from metaros.broker.types import Types
from metaros.broker.v1_json import from_payload
from metaros.concurrency.backlog import Backlog
from metaros.errors import FieldError, MetarosError
from metaros.idl import message_class
from metaros.node import Node, Publisher

__all__ = ["Route"]

_log = logging.getLogger("metaros.broker")
Origin = Literal["map", "graph", "guess"]
_SWITCHES = 3  # so often may a guess turn out wrong
_YOUNG_S = 2.0  # Zenoh needs a moment to tell a new publisher who listens: until then everything is sent
_YOUNG_MESSAGES = 1000  # but not of a flood


class Route:
    """Converts and publishes. It belongs to the bridge's thread; the counters may be read from any."""

    def __init__(
        self,
        node: Node,
        topic: str,
        table: TypeTable,
        types: Types,
        faults: Faults,
        heard: Callable[[], None],
    ) -> None:
        self.topic = topic
        self.queued = False  # whether the bridge knows that something waits
        self.backlog: Backlog[bytes] = Backlog()
        self.messages = self.bytes = self.bridged = self.malformed = 0
        self.gids: set[bytes] = set()
        self._node = node
        self._table = table
        self._types = types
        self._faults = faults
        self._heard = heard
        self._class: type[Any] | None = None
        self._origin: Origin = "guess"
        self._switches = 0
        self._publisher: Publisher | None = None
        self._probe: zenoh.Publisher | None = None
        self._matched = False
        self._young_until_s = 0.0
        self._old_from = 0  # so many bridged messages, or that time, whatever comes first

    def has_listeners(self) -> bool:
        """Whether anybody listens, as far as known."""
        return self._publisher is None or self._matched or self._young()

    def _young(self) -> bool:
        return self.bridged < self._old_from and self._node.clock.monotonic_s() < self._young_until_s

    def ready(self) -> bool:
        """Whether messages can be converted: not while a node is asked for the topic's type."""
        if self._publisher is not None or self._table.type_of(self.topic) is not None:
            return True
        endpoints = others(self._node, self.topic)
        return bool(self._types.classes(endpoints)) or not self._types.pending(endpoints)

    def forward(self, payload: bytes) -> None:
        """Convert one payload and publish it; what cannot be is counted and told once for each kind of fault."""
        try:
            value = parse_payload(payload)
            if self._publisher is None:
                self._open(*self._choose(value))
            message = self._message(value, payload)
            assert self._publisher is not None
            self._publisher.publish(message)
        except MetarosError as error:
            self.malformed += 1
            self._faults.warn_once((self.topic, error.code), f"{self.topic}, from ZeroMQ: {error}")
        except Exception:  # a fault of ours: one topic's, not the bridge's
            self.malformed += 1
            if self._node.first_report(("zmq fault", self.topic)):
                _log.exception("%s: a payload of %d bytes could not be bridged", self.topic, len(payload))
        else:
            self.bridged += 1

    def refresh(self) -> None:
        """The graph has changed: what other nodes say goes before what was guessed."""
        if self._publisher is None or self._origin == "map":
            return
        self._heed_graph()

    def row(self) -> TopicRow:
        """For the report."""
        return TopicRow(
            topic=self.topic,
            direction=Direction.TO_ROS,
            type=_name(self._class),
            messages=self.messages,
            bytes=self.bytes,
            bridged=self.bridged,
            dropped=self.backlog.dropped,
            malformed=self.malformed,
            heard=self._publisher is not None and self._matched,
        )

    def _choose(self, value: Any) -> tuple[type[Any], Origin]:
        mapped = self._table.type_of(self.topic)
        if mapped is not None:
            return message_class(mapped), "map"
        classes = self._types.classes(others(self._node, self.topic))
        return (classes[0], "graph") if classes else (message_class(infer_type(value)), "guess")

    def _heed_graph(self) -> None:
        classes = self._types.classes(others(self._node, self.topic))
        if classes and self._class not in classes:
            self._open(classes[0], "graph")
        elif classes and self._origin == "guess":
            self._origin = "graph"  # a good guess: it stays, whatever is said

    def _message(self, value: Any, payload: bytes) -> Any:
        try:
            return self._convert(value, payload)
        except FieldError:
            if self._origin == "map" or not self._change_type(value):
                raise
            return self._convert(value, payload)

    def _change_type(self, value: Any) -> bool:
        """Something does not fit: whether the topic has another type now."""
        before = self._class
        self._heed_graph()
        if self._class is not before:
            return True
        other = message_class(infer_type(value))
        if self._origin != "guess" or other is before or self._switches >= _SWITCHES:
            return False
        self._switches += 1
        self._open(other, "guess")
        return True

    def _convert(self, value: Any, payload: bytes) -> Any:
        cls = self._class
        assert cls is not None
        data = raw_data(_name(cls), value, payload)
        if data is not None:
            return cls(data=data)
        if isinstance(value, dict):
            value.pop(TYPE_MARKER, None)
        return from_payload(cls, value, ignored=self._ignored)

    def _ignored(self, path: str) -> None:
        text = f"{self.topic}, from ZeroMQ: {_name(self._class)} has no {path.partition('[')[0]}: it is left out"
        self._faults.warn_once((self.topic, "field", path.partition("[")[0]), text)

    def _open(self, cls: type[Any], origin: Origin) -> None:
        """Publish as this type from now on."""
        self.close()
        self._class, self._origin = cls, origin
        self._publisher = self._node.create_publisher(cls, self.topic)
        self.gids.add(self._publisher.gid)
        self._young_until_s = self._node.clock.monotonic_s() + _YOUNG_S
        self._old_from = self.bridged + _YOUNG_MESSAGES
        # a second declaration of the same key, only to be told who listens: tools without a token, too
        self._probe = self._node.context.session.check_open().declare_publisher(self._publisher.key)
        self._on_matching(self._probe.matching_status)
        self._listener = self._probe.declare_matching_listener(self._on_matching)

    def _on_matching(self, status: Any) -> None:  # Zenoh's stub calls it a bool; it is an object
        self._matched = bool(status.matching)
        if self._matched:
            self._heard()

    def close(self) -> None:
        """Leave the topic."""
        if self._publisher is not None and self._probe is not None:
            self._listener.undeclare()  # type: ignore[no-untyped-call]
            self._probe.undeclare()  # type: ignore[no-untyped-call]
            self._publisher.close()
        self._publisher = self._probe = None


def _name(cls: type[Any] | None) -> str:
    return "" if cls is None else str(cls.__metaros_name__)
