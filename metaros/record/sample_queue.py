"""The queue from Zenoh's threads to the writer's: samples wait here, bounded in bytes.

A sample is stamped and its sequence number read where it arrives; its payload is not copied before the writer takes
it. What finds the queue full, or comes during a pause, is refused and noted with its number: it will be a reported gap.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty
from typing import Any, NamedTuple

import zenoh

from metaros.clock import Clock
from metaros.concurrency.waiting import WaitQueue
from metaros.errors import AttachmentError
from metaros.limits import LIMITS
from metaros.record.ledger import Publisher
from metaros.wire import Durability, QoSProfile, parse_attachment
from metaros.wire.attachment import NEW

__all__ = ["Arrival", "Route", "SampleQueue"]

_OVERHEAD_BYTES = 512  # what Zenoh and Python keep beside a payload


@dataclass(slots=True, eq=False)
class Route:
    """A topic of one type: what its channel will say, and what came so far."""

    topic: str
    type_name: str
    type_hash: str
    qos: list[QoSProfile] = field(default_factory=list)
    schema: str | None = None  # None until it was found, or given up: samples wait for it
    publishers: dict[bytes, Publisher] = field(default_factory=dict)
    received: int = 0
    received_bytes: int = 0
    refused: int = 0
    malformed: int = 0

    @property
    def latched(self) -> int:
        """How many last samples its publishers keep for late joiners; 0 where they keep none."""
        kept = [qos.depth for qos in self.qos if qos.durability is Durability.TRANSIENT_LOCAL]
        return max(kept, default=0)


class Arrival(NamedTuple):
    """One sample on its way to the file. `payload` is Zenoh's until the writer copies it."""

    route: Route
    publisher: Publisher
    log_ns: int
    publish_ns: int
    sequence: int
    payload: Any


class SampleQueue:
    """The queue. `sink(route)` is called on Zenoh's threads, `get` on the writer's; `put` wakes the writer."""

    def __init__(self, clock: Clock, *, limit_bytes: int = LIMITS.recorder_queue_bytes) -> None:
        self.paused = False
        self.limit_bytes = limit_bytes
        self._clock = clock
        self._queue: WaitQueue[Arrival | Callable[[], object] | None] = WaitQueue()
        self._lock = threading.Lock()
        self._waiting_bytes = 0

    @property
    def waiting_bytes(self) -> int:
        """What waits for the writer."""
        return self._waiting_bytes

    def sink(self, route: Route) -> Callable[[zenoh.Sample], None]:
        """The callback of a raw subscription."""
        now_ns, unpack, size, put, lock = self._clock.wall_ns, NEW.unpack, NEW.size, self._queue.put, self._lock
        publishers, limit = route.publishers, self.limit_bytes

        def take(sample: zenoh.Sample) -> None:
            log_ns = now_ns()
            attachment = sample.attachment
            data = b"" if attachment is None else attachment.to_bytes()
            try:
                sequence, publish_ns, gid = unpack(data) if len(data) == size else parse_attachment(data)
            except AttachmentError:
                route.malformed += 1
                return
            if publish_ns < 0 or sequence < 0 or len(gid) != 16:
                route.malformed += 1
                return
            publisher = publishers.get(gid) or _meet(route, gid)
            payload = sample.payload
            length = len(payload)
            with lock:
                route.received += 1
                route.received_bytes += length
                waiting = self._waiting_bytes + length + _OVERHEAD_BYTES
                if waiting > limit or self.paused:
                    reason = "paused" if self.paused else "dropped"
                    route.refused += not self.paused
                    publisher.refuse(sequence, reason)
                    return
                self._waiting_bytes = waiting
            put(Arrival(route, publisher, log_ns, publish_ns, sequence, payload))

        return take

    def put(self, call: Callable[[], object] | None) -> None:
        """Have the writer call this between two samples; None ends it."""
        self._queue.put(call)

    def get(self, timeout_s: float) -> Arrival | Callable[[], object] | None:
        """The next; raises queue.Empty."""
        return self._queue.get(timeout_s)

    def done(self, arrival: Arrival) -> None:
        """The writer has no further use for the payload."""
        with self._lock:
            self._waiting_bytes -= len(arrival.payload) + _OVERHEAD_BYTES

    def rest(self) -> list[Arrival | Callable[[], object] | None]:
        """What is still in the queue, at the end."""
        left: list[Arrival | Callable[[], object] | None] = []
        while True:
            try:
                left.append(self._queue.get_nowait())
            except Empty:
                return left


def _meet(route: Route, gid: bytes) -> Publisher:
    """A publisher's first sample."""
    publishers = route.publishers
    while len(publishers) >= LIMITS.recorder_publishers:
        publishers.pop(next(iter(publishers)), None)
    return publishers.setdefault(gid, Publisher(route.topic, route.type_name, gid))
