"""From tapped samples to the queues of the uplink: count, read metrics, select, append. Runs on the event loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, SupportsBytes

from edge_agent.batch import Linger
from edge_agent.channels import METRIC_STREAM, Channel
from edge_agent.live import LiveQueue
from edge_agent.outbox import Outbox
from metaros.errors import DecodeError
from metaros.limits import LIMITS, Limits

__all__ = ["Arrival", "Pipeline"]


class Arrival(NamedTuple):
    """A sample as the tap hands it over; the payload stays Zenoh's until somebody wants its bytes."""

    channel: Channel
    payload: SupportsBytes
    size_bytes: int
    stamp_ns: int
    arrived_s: float


class Pipeline:
    """Feeds the outbox and the live queue, and wakes the uplink once a batch of arrivals."""

    def __init__(
        self, outbox: Outbox, live: LiveQueue, linger: Linger, *, wake: Callable[[], None], limits: Limits = LIMITS
    ) -> None:
        self._outbox = outbox
        self._live = live
        self._linger = linger
        self._wake = wake
        self._limits = limits
        self.malformed = 0

    def take(self, arrivals: Iterable[Arrival], now_s: float) -> None:
        """Take over what the tap collected."""
        queued = 0
        for arrival in arrivals:
            arrival.channel.messages += 1
            arrival.channel.size_bytes += arrival.size_bytes
            queued += self._one(arrival)
        if queued:
            self._linger.add(queued, now_s)
            self._wake()

    def _one(self, arrival: Arrival) -> int:
        """Bytes queued for one sample."""
        channel, queued = arrival.channel, 0
        metrics = channel.metrics
        if metrics is not None and metrics.due(arrival.arrived_s):
            queued += self._rows(channel, arrival)
        if channel.selector.admit(arrival.arrived_s):
            queued += self._sample(channel, arrival)
        return queued

    def _rows(self, channel: Channel, arrival: Arrival) -> int:
        assert channel.metrics is not None
        try:
            rows = channel.metrics.rows(bytes(arrival.payload))
        except DecodeError:
            self.malformed += 1
            return 0
        for row in rows:
            self._outbox.append(METRIC_STREAM, "metric", arrival.stamp_ns, row)
        return 20 * len(rows)

    def _sample(self, channel: Channel, arrival: Arrival) -> int:
        if arrival.size_bytes > self._limits.sample_bytes:
            channel.dropped += 1
            if channel.delivery != "live":
                self._outbox.give_up(channel.channel_id, channel.delivery, "too_large")
                return 1
            return 0
        payload = bytes(arrival.payload)
        if channel.delivery == "live":
            self._live.append(channel, arrival.stamp_ns, payload)
        else:
            self._outbox.append(channel.channel_id, channel.delivery, arrival.stamp_ns, payload)
        return arrival.size_bytes
