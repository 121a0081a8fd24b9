"""What publishers, subscriptions, service servers and clients have in common: a key, a token, a GID and `close`."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh

from metaros.errors import ClosedError
from metaros.node.core import NodeCore
from metaros.node.events.endpoint_monitor import EndpointMonitor
from metaros.node.mixed.twin_key import TwinKey, other_hash
from metaros.wire import DataKey, EndpointToken, QoSProfile
from metaros.wire.liveliness_tokens import EndpointKind
from metaros.wire.names import NO_HASH

__all__ = ["Endpoint", "as_qos"]

_log = logging.getLogger("metaros.node")


def as_qos(qos: QoSProfile | int) -> QoSProfile:
    """A profile, or the default profile with another depth."""
    return qos.resolved() if isinstance(qos, QoSProfile) else QoSProfile(depth=qos).resolved()


class Endpoint:
    """One endpoint of a node. It is in the graph from `announce` to `close`."""

    def __init__(
        self, node: NodeCore, kind: EndpointKind, name: str, type_name: str, type_hash: str, qos: QoSProfile
    ) -> None:
        self.node = node
        self.topic = node.resolve(name, service=kind in ("SS", "SC"))
        self.type_name = type_name
        self.type_hash = type_hash
        self.qos = qos
        self.closed = False
        session = node.context.session
        session.check_open()
        declared = type_hash if session.writes_hashes else NO_HASH
        self.twin_hash = other_hash(type_name, type_hash, declared)
        self.twin: TwinKey | None = None
        self.key = str(DataKey(session.domain, self.topic, type_name, declared))
        self.token = EndpointToken(node.token, session.next_id(), kind, self.topic, type_name, declared, qos.encode())
        self.gid = self.token.gid
        self.events: EndpointMonitor = EndpointMonitor(node, self.token, warn_once=self.warn_once)
        self._closers: list[Callable[[], object]] = []
        self._tokens: list[Any] = []

    @property
    def mismatched(self) -> int:
        """Peers that came to this name with another type or hash: nothing passes between us."""
        return self.events.type_hash_mismatch

    def on_close(self, closer: Callable[[], object]) -> None:
        """Call this on close; the last one registered is called first."""
        self._closers.append(closer)

    def announce(self) -> None:
        """Declare the liveliness token: others see the endpoint from now on."""
        declare = self.node.context.session.check_open().liveliness().declare_token
        # Without Python in between: a token that Ctrl-C drops at once calls back amid its exception, which is lost.
        self._tokens.extend(map(declare, (str(self.token),)))
        self.on_close(self._tokens[0].undeclare)
        graph = self.node.context.graph
        graph.add_own(self.token)
        self.on_close(lambda: graph.discard_own(self.token))
        watch, events = self.node.context.watch, self.events
        self.on_close(events.close)
        watch.add(self.topic, events)
        self.on_close(lambda: watch.discard(self.topic, events))
        if (twin := self.twin) is not None:
            self.on_close(twin.close)
            watch.add(self.topic, twin)
            self.on_close(lambda: watch.discard(self.topic, twin))
        try:
            self.node.adopt(self)
        except ClosedError:  # the node ended before or meanwhile: nobody else would take the endpoint back
            self.close()
            raise

    def speak_both(
        self,
        open_twin: Callable[[str], None],
        *,
        present: Callable[[bool], None] | None = None,
        with_the_first: bool = False,
    ) -> None:
        """From `announce` on use a second key while peers of another distribution are there, see `TwinKey`.

        `with_the_first`: as soon as one is there at all, so that who comes to this name does not have to wait for us.
        """
        if self.twin_hash:
            self.twin = twin = TwinKey(self.token, self.twin_hash, open_twin=open_twin, present=present)
            if with_the_first:
                self.on_close(self.node.context.watch.when(twin.open, hashes=self.twin_hash != NO_HASH))

    def close(self) -> None:
        """Leave the graph and stop. Safe to call twice."""
        if self.closed:
            return
        self.closed = True
        self.node.release(self)
        while self._closers:
            with suppress(zenoh.ZError):  # the session went first
                self._closers.pop()()

    def report_once(self, about: Any, text: str) -> bool:
        """Log a fault of a peer, once for each `about` (such as its GID): faults repeat at the topic's rate."""
        first = self.node.first_report((self.token.eid, about))
        if first:
            _log.warning("%s %s: %s", self.node.full_name, self.topic, text)
        return first

    def warn_once(self, about: Any, text: str) -> None:
        """Have the node warn, here and on /rosout, once for each `about`."""
        if self.node.first_report((self.token.eid, about)):
            self.node.get_logger().warn(text)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
