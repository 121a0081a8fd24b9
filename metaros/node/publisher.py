"""Publishers: typed ones encode, raw ones take CDR; both stamp every sample as rmw_zenoh does."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from typing import Any, Protocol

import zenoh
import zenoh.ext

from metaros.cdr import Codec
from metaros.clock import Clock
from metaros.concurrency.waiting import pause
from metaros.errors import ClosedError, FieldError, TooLargeError
from metaros.limits import LIMITS
from metaros.node.core import NodeCore
from metaros.node.endpoint import Endpoint
from metaros.node.events.callbacks import PublisherEvents
from metaros.node.events.publisher_monitor import PublisherMonitor
from metaros.node.mixed.publisher_twin import PublisherTwin, Put, both
from metaros.wire import Durability, QoSProfile, Reliability
from metaros.wire.attachment import NEW
from metaros.wire.shm import SharedPool

__all__ = ["Publisher", "RawPublisher"]

_log = logging.getLogger("metaros.node")
_UNDECLARE_TRIES = 2000  # of a millisecond: longer than Zenoh blocks a put before it gives up
_BUFFERS = (bytes, bytearray, memoryview)
_LARGE = LIMITS.shared_memory_threshold_bytes


class Publish(Protocol):
    """`publish(message)`; `stamp_ns` is the source time of a replayed message."""

    def __call__(self, message: Any, *, stamp_ns: int | None = None) -> None:
        """Send one message."""


class RawPublisher(Endpoint):
    """Publishes CDR bytes under a type that need not be known."""

    publish: Publish
    events: PublisherMonitor

    def __init__(
        self,
        node: NodeCore,
        topic: str,
        type_name: str,
        type_hash: str,
        qos: QoSProfile,
        *,
        message_type: type[Any] | None = None,
        encode: Callable[[Any], bytes] = bytes,
        events: PublisherEvents | None = None,
    ) -> None:
        super().__init__(node, "MP", topic, type_name, type_hash, qos)
        self.events = PublisherMonitor(self, events)
        session = node.context.session
        publisher = _declare(session.check_open(), self.key, qos)
        self.on_close(lambda: _undeclare(publisher))
        monitors = [] if self.events.sent is None else [self.events.sent]
        if isinstance(publisher, zenoh.ext.AdvancedPublisher) and _reliable(qos):
            monitors.append(self._start_sporadic_heartbeat(publisher))
        latched = qos.durability is Durability.TRANSIENT_LOCAL
        place = _sized(self.topic, None if latched else session.shared_pool)
        publish, retire, also = _publish(
            self, node.context.clock, publisher.put, message_type=message_type, encode=encode, place=place
        )
        for sent in monitors:
            publish = _and_note(publish, sent)
        self.publish = publish
        self.on_close(retire)
        twin = PublisherTwin(
            session.zenoh, self.key, declare=self._declare_twin, also=also, depth=qos.depth if latched else 0
        )
        self.speak_both(twin.open, present=twin.present, with_the_first=latched)
        self.announce()

    def _declare_twin(self, key: str) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
        publisher = _declare(self.node.context.session.check_open(), key, self.qos)
        self._closers.insert(0, lambda: _undeclare(publisher))  # last: `retire` comes before
        return publisher

    def _start_sporadic_heartbeat(self, publisher: zenoh.ext.AdvancedPublisher) -> Callable[[], None]:
        """Sporadic heartbeats for as long as it is open; what to call after each sample."""
        context = self.node.context
        sent, heartbeat = context.sporadic.follow(context.session.check_open(), publisher)
        self.on_close(lambda: _undeclare(heartbeat))
        self.on_close(lambda: context.sporadic.leave(heartbeat))
        return sent

    def assert_liveliness(self) -> None:
        """Say that the publisher lives, without a sample: for manual liveliness with a lease; else needless."""
        if self.closed:
            raise ClosedError(f"assert_liveliness on {self.topic}: the publisher was closed")
        self.events.assert_alive()


class Publisher(RawPublisher):
    """Publishes messages of one class; bytes are taken for CDR of that class and go out unread."""

    def __init__(
        self,
        node: NodeCore,
        message_type: type[Any],
        topic: str,
        codec: Codec,
        qos: QoSProfile,
        events: PublisherEvents | None = None,
    ) -> None:
        self.message_type = message_type
        encode = codec.encode
        super().__init__(
            node, topic, codec.name, codec.hash, qos, message_type=message_type, encode=encode, events=events
        )


def _declare(session: zenoh.Session, key: str, qos: QoSProfile) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
    reliable = _reliable(qos)
    options: dict[str, Any] = {
        "congestion_control": zenoh.CongestionControl.BLOCK if qos.blocks else zenoh.CongestionControl.DROP,
        "priority": getattr(zenoh.Priority, qos.priority.name),
        "reliability": zenoh.Reliability.RELIABLE if reliable else zenoh.Reliability.BEST_EFFORT,
    }
    if qos.durability is not Durability.TRANSIENT_LOCAL:
        return session.declare_publisher(key, **options)
    if reliable:
        numbered = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None)  # see sporadic.py
        options["sample_miss_detection"] = numbered
    cache = zenoh.ext.CacheConfig(max_samples=qos.depth)
    return zenoh.ext.declare_advanced_publisher(session, key, cache=cache, publisher_detection=True, **options)


def _reliable(qos: QoSProfile) -> bool:
    return qos.reliability is not Reliability.BEST_EFFORT


def _and_note(publish: Publish, sent: Callable[[], None]) -> Publish:
    """The same `publish` for a publisher with a deadline or a lease to keep, or whose samples are counted."""

    def publish_and_note(message: Any, *, stamp_ns: int | None = None) -> None:
        publish(message, stamp_ns=stamp_ns)
        sent()

    return publish_and_note


def _undeclare(publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher) -> None:
    """Undeclare once no other thread is inside its `put`: Zenoh refuses while one is."""
    for _ in range(_UNDECLARE_TRIES):
        try:
            publisher.undeclare()  # type: ignore[no-untyped-call]
        except RuntimeError:
            pause(0.001)
        else:
            return
    _log.warning("a publisher was left to the session's close: its put() does not return")


def _sized(topic: str, pool: SharedPool | None) -> Callable[[bytes], Any]:
    """What becomes of a large payload: refused, as it is, or in shared memory.

    A cache of samples would keep the pool's memory for good, so transient_local publishers do without it.
    """
    limit, share = LIMITS.sample_bytes, None if pool is None else pool.place

    def place(data: bytes) -> Any:
        if len(data) > limit:
            raise TooLargeError(f"a message of {len(data)} bytes on {topic}: the limit is {limit}")
        return data if share is None else share(data)

    return place


def _publish(
    endpoint: Endpoint,
    clock: Clock,
    put: Callable[..., None],
    *,
    message_type: type[Any] | None,
    encode: Callable[[Any], bytes],
    place: Callable[[bytes], Any],
) -> tuple[Publish, Callable[[], None], Callable[[Put | None], None]]:
    """The hot path: one class check, one encode, one pack, one put; no lock, no attribute look-up.

    The second function ends it: publishing goes on raising ClosedError, so that `undeclare` finds the publisher idle.
    The third gives the put of a second publisher, or takes it back.
    """
    alone = put
    next_seq, pack, now_ns, large = itertools.count(1).__next__, NEW.pack, clock.wall_ns, _LARGE
    gid, topic, type_name = endpoint.gid, endpoint.topic, endpoint.type_name

    def publish(message: Any, *, stamp_ns: int | None = None) -> None:
        kind = message.__class__
        if kind is message_type:
            data = encode(message)
        elif kind is bytes:
            data = message
        elif isinstance(message, _BUFFERS):
            data = bytes(message)
        else:
            raise FieldError(f"{topic} carries {type_name}, not {type(message).__name__}")
        payload = data if len(data) < large else place(data)
        try:
            put(payload, attachment=pack(next_seq(), now_ns() if stamp_ns is None else stamp_ns, gid))
        except zenoh.ZError as error:
            raise ClosedError(f"publish on {topic}: {error}") from None
        except RuntimeError as error:  # Zenoh's object is being undeclared on another thread at this very moment
            if not endpoint.closed:
                raise
            raise ClosedError(f"publish on {topic}: {error}") from None

    def retire() -> None:
        nonlocal put, alone
        put = alone = refuse

    def also(other: Put | None) -> None:
        nonlocal put
        put = alone if other is None or alone is refuse else both(alone, other)

    def refuse(*_: object, **__: object) -> None:
        raise ClosedError(f"publish on {topic}: the publisher was closed")

    return publish, retire, also
