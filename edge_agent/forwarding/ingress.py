"""The crossing from Zenoh's threads to the event loop: one C-callable put a sample, one wake-up a batch.

Zenoh calls `sink`, which is SimpleQueue.put itself. One thread drains that queue, reads each sample's attachment, and
keeps what the loop has not yet taken under a bound in bytes: what is over it is dropped and counted on its channel.
The payload is not copied here; most live samples are dropped by the selection and never become Python bytes.

What comes gathers first, in the place of a gathering further on, which counts from its arrival: what somebody watches
for as long as live samples linger, and while nobody watches as long as the outbox gathers. So a batch costs its two
wake-ups once, and a robot that is left alone wakes twenty times a second, whatever its topics do.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any

from edge_agent.forwarding.channels import Channel
from edge_agent.forwarding.live_batch import FLUSH_BYTES
from edge_agent.forwarding.pipeline import Arrival
from metaros.clock import Clock
from metaros.errors import AttachmentError
from metaros.limits import LIMITS
from metaros.wire.attachment import parse_attachment

__all__ = ["Ingress"]

AT_ONCE = 256
GATHER_S = 0.05  # while nobody watches
GATHER_BYTES = 1 << 20  # what came at more than so much a gathering is not kept waiting
Route = Callable[[str, bytes], Channel | None]


class Ingress:
    """Owns the draining thread. `route(key, sender gid)` names a sample's channel and must be safe on that thread."""

    def __init__(
        self,
        route: Route,
        take: Callable[[list[Arrival], float], None],
        wake: Callable[[Callable[[], None]], object],
        clock: Clock,
        *,
        max_bytes: int = LIMITS.ingress_bytes,
        record: Callable[[list[Arrival]], None] | None = None,
        watched: Callable[[], bool] = lambda: True,
        linger_s: float = LIMITS.linger_s,
    ) -> None:
        """`record` is given everything on the draining thread, also what the loop has no room for.

        `watched` says on that thread whether somebody waits for what comes; then it gathers for `linger_s`.
        """
        self._linger_s = linger_s
        self._watched = watched
        self._record = record
        self._route = route
        self._take = take
        self._wake = wake
        self._clock = clock
        self._max_bytes = max_bytes
        self._queue: SimpleQueue[Any] = SimpleQueue()
        self.sink: Callable[[Any], None] = self._queue.put
        self._bell = threading.Event()
        self._lock = threading.Lock()
        self._ready: list[Arrival] = []
        self._ready_bytes = 0
        self._overflow: Counter[int] = Counter()
        self._dropped_channels: dict[int, Channel] = {}
        self.malformed: Counter[str] = Counter()
        self._thread = threading.Thread(target=self._drain, name="tap-drain", daemon=True)
        self._thread.start()

    def urgent_sink(self, sample: Any) -> None:
        """The sink of what may not gather, whether anybody watches or not."""
        self._queue.put(sample)
        self._bell.set()

    def hurry(self) -> None:
        """What gathers is wanted now."""
        self._bell.set()

    def close(self) -> None:
        """Stop the thread; what is queued is forgotten."""
        self._queue.put(None)
        self._bell.set()
        self._thread.join()

    def _drain(self) -> None:
        behind = False
        while True:
            samples = [self._queue.get()]
            since_s = self._clock.monotonic_s()
            if not behind and samples[0] is not None and len(samples[0].payload) < FLUSH_BYTES:
                self._bell.wait(self._linger_s if self._watched() else GATHER_S)
                self._bell.clear()
            try:
                while len(samples) < AT_ONCE:
                    samples.append(self._queue.get_nowait())
            except Empty:
                pass
            if None in samples:
                return
            arrivals = self._read_all(samples, since_s)
            if arrivals:
                if self._record is not None:
                    self._record(arrivals)
                self._offer(arrivals)
            size_bytes = sum(arrival.size_bytes for arrival in arrivals)
            behind = len(samples) == AT_ONCE or size_bytes > GATHER_BYTES

    def _read_all(self, samples: list[Any], since_s: float) -> list[Arrival]:
        """What came from `since_s` until now, as if it had come evenly."""
        apart_s = (self._clock.monotonic_s() - since_s) / len(samples)
        found = (self._read(sample, since_s + index * apart_s) for index, sample in enumerate(samples))
        return [arrival for arrival in found if arrival is not None]

    def _read(self, sample: Any, now_s: float) -> Arrival | None:
        key = str(sample.key_expr)
        try:
            if sample.attachment is None:
                raise AttachmentError("no attachment")
            attachment = parse_attachment(bytes(sample.attachment))
        except AttachmentError:
            self.malformed[key] += 1
            return None
        channel = self._route(key, attachment.gid)
        if channel is None:
            return None
        payload = sample.payload
        return Arrival(channel, payload, len(payload), attachment.source_ns, now_s, attachment.gid, attachment.seq)

    def _offer(self, arrivals: list[Arrival]) -> None:
        """Put arrivals where the loop finds them; wake it unless it is awake already."""
        with self._lock:
            idle = not self._ready
            for arrival in arrivals:
                if self._ready_bytes + arrival.size_bytes > self._max_bytes:
                    self._overflow[arrival.channel.channel_id] += 1
                    self._dropped_channels[arrival.channel.channel_id] = arrival.channel
                else:
                    self._ready.append(arrival)
                    self._ready_bytes += arrival.size_bytes
        if idle:
            try:
                self._wake(self._deliver)
            except RuntimeError:  # the loop is closed: the program ends
                return

    def _deliver(self) -> None:
        """On the loop: take everything that is ready."""
        with self._lock:
            arrivals, self._ready = self._ready, []
            self._ready_bytes = 0
            overflow, self._overflow = self._overflow, Counter()
        for channel_id, count in overflow.items():
            channel = self._dropped_channels[channel_id]
            channel.dropped += count
            channel.messages += count
        self._take(arrivals, self._clock.monotonic_s())
