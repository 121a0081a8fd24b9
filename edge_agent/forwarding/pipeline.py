"""From tapped samples to outbox and live queue: count, read metrics, select, append. Runs on the event loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, SupportsBytes

from edge_agent.forwarding.channels import METRIC_STREAM, Channel
from edge_agent.forwarding.latest import LatestOnly
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.sample_trace import Tracer
from edge_agent.forwarding.video_selector import VideoSelector
from edge_agent.outbox import Outbox
from metaros.errors import DecodeError
from metaros.limits import LIMITS, Limits
from metaros.seal.envelope import OVERHEAD_BYTES

__all__ = ["Arrival", "Pipeline"]


class Arrival(NamedTuple):
    """A sample as the tap hands it over; the payload stays Zenoh's until somebody wants its bytes."""

    channel: Channel
    payload: SupportsBytes
    size_bytes: int
    stamp_ns: int
    arrived_s: float
    gid: bytes = b""  # whose sample it is,
    sequence: int = 0  # and as its how-manieth


class Pipeline:
    """Feeds the outbox and the live queue, and wakes who serves them, once a batch of arrivals."""

    def __init__(
        self,
        outbox: Outbox,
        live: LiveQueue,
        linger: Linger,
        *,
        wake_writer: Callable[[], None],
        wake_uplink: Callable[[], None],
        limits: Limits = LIMITS,
        tracer: Tracer | None = None,
        watched: Callable[[], bool] = lambda: True,
        patience_s: float = 0.0,
    ) -> None:
        """What was thinned to a few a second, rows and copies, gathers `patience_s` longer while nobody watches."""
        self._watched, self._patience_s = watched, patience_s
        self._more_s = 0.0  # the patience of what is being taken over
        self._tracer = tracer
        self._outbox = outbox
        self._live = live
        self._linger = linger
        self._wake_writer = wake_writer
        self._wake_uplink = wake_uplink
        self._limits = limits
        self._latest = LatestOnly(outbox, wake_writer)
        self._kept = False  # something of what is being taken over is for the outbox
        self.malformed = 0

    def take(self, arrivals: Iterable[Arrival], now_s: float) -> None:
        """Take over what the tap collected."""
        live_bytes, since_s = 0, now_s
        self._more_s = 0.0 if self._watched() else self._patience_s
        for arrival in arrivals:
            arrival.channel.messages += 1
            arrival.channel.size_bytes += arrival.size_bytes
            if size_bytes := self._one(arrival):
                live_bytes += size_bytes
                since_s = min(since_s, arrival.arrived_s)
        if self._kept:
            self._kept = False
            self._wake_writer()
        if live_bytes:
            self._linger.add(live_bytes, since_s)
            self._wake_uplink()

    def _one(self, arrival: Arrival) -> int:
        """Take one sample; how many bytes of it are live."""
        channel = arrival.channel
        metrics = channel.metrics
        if metrics is not None and metrics.due(arrival.arrived_s):
            self._rows(channel, arrival)
        if channel.copy is not None and admits(channel.copy, arrival):
            self._sample(channel.copy, arrival)
        return self._sample(channel, arrival) if admits(channel, arrival) else 0

    def _rows(self, channel: Channel, arrival: Arrival) -> None:
        assert channel.metrics is not None
        try:
            rows = channel.metrics.rows(bytes(arrival.payload), arrival.arrived_s)
        except DecodeError:
            self.malformed += 1
            return
        for row in rows:
            self._outbox.append(METRIC_STREAM, "metric", arrival.stamp_ns, row, arrival.arrived_s + self._more_s)
            self._kept = True

    def _sample(self, channel: Channel, arrival: Arrival) -> int:
        live = channel.delivery == "live"
        if arrival.size_bytes + (OVERHEAD_BYTES if channel.sealed else 0) > self._limits.sample_bytes:
            channel.dropped += 1
            if not live:
                self._kept = True
                self._outbox.give_up(channel.channel_id, channel.delivery, "too_large")
            return 0
        payload = bytes(arrival.payload)
        if channel.deadband is not None and not channel.deadband.passes(payload, arrival.arrived_s):
            channel.thinned += 1
            return 0
        if self._tracer is not None:
            self._tracer.taken(channel.channel_id, arrival.stamp_ns, arrival.arrived_s)
        if live:
            self._live.append(channel, arrival.stamp_ns, payload)
            return arrival.size_bytes
        self._kept = True
        if channel.rule.latest_only and channel.delivery == "bulk":
            self._latest.put(channel, arrival.stamp_ns, payload)
        else:
            came_s = arrival.arrived_s + (self._more_s if channel.history else 0.0)
            self._outbox.append(channel.channel_id, channel.delivery, arrival.stamp_ns, payload, came_s)
        return 0


def admits(channel: Channel, arrival: Arrival) -> bool:
    """Whether a sample of that channel leaves the robot."""
    selector = channel.selector
    if isinstance(selector, VideoSelector):
        return selector.takes(arrival.payload, arrival.gid, arrival.sequence, arrival.arrived_s)
    return selector.admit(arrival.arrived_s)
