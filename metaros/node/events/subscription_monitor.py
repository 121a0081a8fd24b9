"""What a subscription requests: samples in time, samples not too old, publishers alive, nothing lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

from metaros.executor import Mailbox
from metaros.node.endpoint import Endpoint
from metaros.node.events.callbacks import SubscriptionEvents
from metaros.node.events.deadline import DeadlineMonitor
from metaros.node.events.endpoint_monitor import EndpointMonitor
from metaros.node.events.event_types import DeadlineMissed, LivelinessChanged, MessageLost
from metaros.node.events.liveliness import LivelinessMonitor
from metaros.node.events.peers import Peer
from metaros.node.events.publisher_monitor import alive_key, lease_s
from metaros.node.events.timed_check import TimedCheck
from metaros.node.info import MessageInfo
from metaros.wire.qos import INFINITE_NS, Liveliness

__all__ = ["SubscriptionMonitor"]

_ASSERTIONS = 256  # of publishers that say they live, waiting for the executor


class SubscriptionMonitor(EndpointMonitor):
    """Looks at each sample's info only once something requires it: `on_inspect(accept)` is called then, once."""

    def __init__(
        self,
        endpoint: Endpoint,
        callbacks: SubscriptionEvents | None,
        *,
        on_inspect: Callable[[Callable[[MessageInfo], bool]], None],
        waiting: Callable[[], bool],
    ) -> None:
        super().__init__(endpoint.node, endpoint.token, callbacks, warn_once=endpoint.warn_once)
        self._endpoint = endpoint
        qos, self._clock = endpoint.qos, endpoint.node.context.clock
        self.expired = 0
        self._on_inspect = on_inspect
        self._waiting = waiting
        self._inspecting = False
        self._lifespans: dict[bytes, int] = {}
        self._deadline = DeadlineMonitor(qos.deadline_ns / 1e9) if qos.deadline_ns != INFINITE_NS else None
        self._last_gid = b""
        asks = qos.lease_ns != INFINITE_NS or qos.liveliness is not Liveliness.AUTOMATIC
        asks = asks or self._dispatcher.wants("liveliness_changed")
        self._liveliness = LivelinessMonitor(endpoint.topic) if asks else None
        self._listening = False
        self._timed_check: TimedCheck | None = None
        if self._deadline is not None:
            self._wake()
        if self._deadline is not None or qos.lifespan_ns != INFINITE_NS:
            self._inspect()

    # -- counts ----------------------------------------------------------------------------------------------------

    @property
    def deadline_missed(self) -> int:
        """Periods without a sample."""
        self._check(self._clock.monotonic_s())
        return 0 if self._deadline is None else self._deadline.total

    @property
    def alive(self) -> int:
        """Publishers that are alive; all that match where nobody asked for liveliness."""
        return self.matched if self._liveliness is None else self._liveliness.alive

    @property
    def not_alive(self) -> int:
        """Publishers in the graph that let their lease pass."""
        return 0 if self._liveliness is None else self._liveliness.not_alive

    # -- samples ---------------------------------------------------------------------------------------------------

    def missing(self, total: int, change: int, gid: bytes) -> None:
        """A publisher's sequence has a gap."""
        if self._dispatcher.wants("message_lost"):
            with self._lock:
                node = self._peers.node_of(gid)
            event = MessageLost(topic=self._endpoint.topic, node=node, total=total, change=change)
            self._dispatcher.send("message_lost", event)

    def accept(self, info: MessageInfo) -> bool:
        """Whether a sample is fresh enough for the callback; it is a sign of life in any case."""
        now_s, gid = self._clock.monotonic_s(), info.gid
        with self._lock:
            if self._liveliness is not None:
                self._renew_liveliness(gid, now_s)
            own = self._endpoint.qos.lifespan_ns
            if info.received_stamp_ns - info.source_stamp_ns > min(own, self._lifespans.get(gid, own)):
                self.expired += 1
                return False
            if self._deadline is not None:
                self._last_gid = gid
                self._deadline.mark(now_s)
        return True

    def _inspect(self) -> None:
        if not self._inspecting:
            self._inspecting = True
            self._on_inspect(self.accept)

    # -- publishers ------------------------------------------------------------------------------------------------

    def _peer_came(self, peer: Peer) -> None:
        token = peer.token
        if token.qos.lifespan_ns != INFINITE_NS and not (peer.mismatch and peer.mismatch.silent):
            self._lifespans[token.gid] = token.qos.lifespan_ns
            self._inspect()
        if self._liveliness is None or peer.mismatch is not None:
            return
        lease = lease_s(token.qos)
        self._report(self._liveliness.add(token.gid, token.node.full_name, lease, self._clock.monotonic_s()))
        if lease is not None:
            self._inspect()
            self._listen()
            self._wake()

    def _peer_went(self, peer: Peer) -> None:
        self._lifespans.pop(peer.token.gid, None)
        if self._liveliness is not None:
            self._report(self._liveliness.discard(peer.token.gid))

    def _renew_liveliness(self, gid: bytes, now_s: float) -> None:
        if self._liveliness is not None:
            event = self._liveliness.renew(gid, now_s)
            self._report(event)
            if event is not None:
                self._wake()

    def _report(self, event: LivelinessChanged | None) -> None:
        if event is not None:
            self._dispatcher.send("liveliness_changed", event)

    def _listen(self) -> None:
        """Hear publishers say that they live, too."""
        if self._listening:
            return
        self._listening = True
        endpoint = self._endpoint
        mailbox = Mailbox(self._asserted, owner=endpoint.node, depth=_ASSERTIONS, limit_bytes=1 << 20, size_of=_weight)
        handler = zenoh.handlers.Callback(endpoint.node.ingress.put_to(mailbox), indirect=False)
        session = endpoint.node.context.session.check_open()
        endpoint.on_close(session.declare_subscriber(alive_key(endpoint.key, "*"), handler).undeclare)

    def _asserted(self, sample: zenoh.Sample) -> None:
        text = str(sample.key_expr).rpartition("/")[2]
        with self._lock:
            for token in self._peers.tokens():
                if token.gid.hex() == text:
                    self._renew_liveliness(token.gid, self._clock.monotonic_s())

    # -- time ------------------------------------------------------------------------------------------------------

    def _wake(self) -> None:
        if self._timed_check is None:
            self._timed_check = TimedCheck(self._endpoint.node, self._check)
        self._timed_check.reschedule()

    def _check(self, now_s: float) -> float | None:
        endpoint = self._endpoint
        if self._deadline is not None:
            endpoint.node.ingress.collect()
        dues: list[float] = []
        with self._lock:
            if self._deadline is not None:
                if self._waiting():  # what came while callbacks were busy came in time
                    self._deadline.excuse(now_s)
                missed = self._deadline.check(now_s)
                if missed:
                    event: Any = DeadlineMissed(
                        topic=endpoint.topic,
                        node=self._peers.node_of(self._last_gid),
                        total=self._deadline.total,
                        change=missed,
                    )
                    self._dispatcher.send("deadline_missed", event)
                dues.append(self._deadline.next_check_s(now_s))
            if self._liveliness is not None:
                for changed in self._liveliness.check(now_s):
                    self._report(changed)
                due_s = self._liveliness.next_check_s()
                dues += [] if due_s is None else [due_s]
        return min(dues, default=None)

    def close(self) -> None:
        """Request nothing more."""
        super().close()
        if self._timed_check is not None:
            self._timed_check.close()


def _weight(_: object) -> int:
    return 128
