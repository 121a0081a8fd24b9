"""A topic's bytes read by the main thread, and the rate of what arrives.

They come from this machine's graph (`LocalTopicSource`) or from a remote robot by its gateway (`RemoteTopicSource`).
Zenoh's thread only stamps a sample and puts it into a queue of at most `LIMITS.ingress_bytes`; when that is full, new
samples are dropped and counted: a reader must never slow down the publisher.
"""

from __future__ import annotations

import math
import queue
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Protocol

from metaros.cli.shared.connection import connect
from metaros.cli.shared.topic_lookup import find_topic
from metaros.clock import SystemClock
from metaros.concurrency.waiting import WaitQueue
from metaros.errors import TimeoutError_
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from metaros.cli.shared.topic_lookup import FoundTopic

__all__ = ["Listener", "LocalTopicSource", "Rate", "TopicMeter", "TopicSource"]

_SLICE_S = 0.1  # waiting in slices keeps Ctrl-C immediate on every platform
REPORT_S = 1.0
_FIRST_GAP_S = 60.0  # so long one message waits for a second one: slow topics have a rate, too


class TopicMeter(Protocol):
    """What computes statistics of a topic from its samples."""

    def add(self, now: float, payload: bytes) -> None:
        """A message arrived at `now`, by the monotonic clock."""

    def report(self, now: float) -> dict[str, Any]:
        """What is known by `now`; a `window` below 2 means that there is nothing to say."""


class TopicSource(Protocol):
    """Where a topic's samples come from."""

    dropped: int

    def open(self, stack: ExitStack) -> FoundTopic:
        """Begin; what has to be closed is pushed on the stack. UnavailableError where there is no such topic."""

    def next(self, timeout_s: float) -> tuple[float, bytes] | None:
        """The next sample and when it came, by the monotonic clock; None when none came in time."""


class Listener:
    """Subscribe in a context manager; `payloads()` gives CDR bytes as they come."""

    def __init__(self, source: TopicSource) -> None:
        self._source = source
        self._clock = SystemClock()
        self._stack = ExitStack()
        self.found: FoundTopic

    def __enter__(self) -> Listener:
        with ExitStack() as stack:
            self.found = self._source.open(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def payloads(self, *, timeout_s: float = 0.0) -> Iterator[bytes]:
        """Each message's bytes; TimeoutError_ after `timeout_s` (0: never) of silence."""
        last = self._clock.monotonic_s()
        while True:
            if (item := self._source.next(_SLICE_S)) is not None:
                last = self._clock.monotonic_s()
                yield item[1]
            elif timeout_s and self._clock.monotonic_s() - last >= timeout_s:
                raise TimeoutError_(f"no message on {self.found.name} within {timeout_s:g} s")

    def reports(self, meter: TopicMeter) -> Iterator[dict[str, Any]]:
        """Feed `meter` and give its report once a second."""
        due = self._clock.monotonic_s() + REPORT_S
        while True:
            wait = due - self._clock.monotonic_s()
            if wait <= 0:
                due += REPORT_S
                yield {**meter.report(self._clock.monotonic_s()), "dropped": self._source.dropped}
            elif (item := self._source.next(min(wait, _SLICE_S))) is not None:
                meter.add(*item)


class LocalTopicSource:
    """A raw subscription in this machine's graph."""

    def __init__(
        self, topic: str, type_name: str, *, zenoh_port: int, domain: int, spin_time: float, raw: bool
    ) -> None:
        self._ask = (topic, type_name)
        self._where = (zenoh_port, domain)
        self._spin_time = spin_time
        self._raw = raw
        self._clock = SystemClock()
        self._queue: WaitQueue[tuple[float, bytes]] = WaitQueue()
        self._in_bytes = 0  # written by Zenoh's thread only
        self._out_bytes = 0  # written by the main thread only
        self.dropped = 0

    def open(self, stack: ExitStack) -> FoundTopic:
        """See `TopicSource`."""
        from metaros.node import Node

        context = stack.enter_context(connect(*self._where))
        found = find_topic(context, *self._ask, spin_time=self._spin_time, raw=self._raw)
        node = stack.enter_context(Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False))
        reader = node.create_raw_subscription(found.name, found.type_name, found.type_hash, found.qos, self._take)
        stack.callback(reader.close)
        return found

    def next(self, timeout_s: float) -> tuple[float, bytes] | None:
        """See `TopicSource`."""
        try:
            item = self._queue.get(timeout_s)
        except queue.Empty:
            return None
        self._out_bytes += len(item[1])
        return item

    def _take(self, sample: Any) -> None:
        """On Zenoh's thread."""
        payload = bytes(sample.payload)
        if self._in_bytes - self._out_bytes + len(payload) > LIMITS.ingress_bytes:
            self.dropped += 1
            return
        self._in_bytes += len(payload)
        self._queue.put((self._clock.monotonic_s(), payload))


class Rate:
    """Arrival times and sizes of the last `window` messages. Pure."""

    def __init__(self, window: int) -> None:
        self._arrivals: deque[tuple[float, int]] = deque(maxlen=window)

    def add(self, now: float, payload: bytes) -> None:
        """A message arrived."""
        self._arrivals.append((now, len(payload)))

    def report(self, now: float) -> dict[str, Any]:
        """Rates over the window; `window` below 2 means that there is nothing to say."""
        sizes = [size for _, size in self._arrivals]
        gaps = [later[0] - earlier[0] for earlier, later in zip(self._arrivals, list(self._arrivals)[1:], strict=False)]
        patience = max(3 * max(gaps), 2 * REPORT_S) if gaps else _FIRST_GAP_S
        if self._arrivals and now - self._arrivals[-1][0] > patience:
            self._arrivals.clear()  # it fell silent: the next messages are a new measurement
        if len(self._arrivals) < 2:
            return {"window": len(self._arrivals)}
        mean = sum(gaps) / len(gaps)
        elapsed = max(now - self._arrivals[0][0], 1e-9)
        return {
            "rate_hz": 1.0 / mean if mean else 0.0,
            "min_s": min(gaps),
            "max_s": max(gaps),
            "std_s": math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps)),
            "bytes_per_s": sum(sizes) / elapsed,
            "mean_bytes": sum(sizes) / len(sizes),
            "min_bytes": min(sizes),
            "max_bytes": max(sizes),
            "window": len(sizes),
        }
