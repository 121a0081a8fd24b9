"""How much one robot may send: a token bucket over messages and one over bytes, which outlive its sessions. Pure.

A bucket holds two seconds of the rate. What is taken may overdraw it, so that a batch of any size gets through and is
paid for afterwards. Who comes first where it is short is told by how deep each may draw: events below zero, other
durable frames down to zero, live samples down to a half. Durable frames that were put off come back when the bucket is
half full, so that neither live samples nor each other can keep them out for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gateway.domain.channel import EVENT, LIVE
from metaros._proto import link_pb2
from metaros.limits import Limits

__all__ = ["Meter", "Quota"]

BURST_S = 2.0
WINDOW_S = 0.5  # of the byte rate may be on its way: what is put off was sent in vain
LEAST_WINDOW_BYTES = 256 * 1024
LEAST_WAIT_S, MOST_WAIT_S = 0.001, 30.0
FLOORS = {EVENT: -1.0, LIVE: 0.5}  # of the bucket; other classes: 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Quota:
    """What each robot may send a second, samples and metric rows counted alike; 0 means no limit."""

    messages_per_s: float = 0.0
    bytes_per_s: float = 0.0

    def window_bytes(self, limits: Limits) -> int:
        """How much of a lane may be unacknowledged."""
        if not self.bytes_per_s:
            return limits.window_bytes
        return min(limits.window_bytes, max(LEAST_WINDOW_BYTES, round(self.bytes_per_s * WINDOW_S)))


class Meter:
    """One robot's buckets."""

    def __init__(self, quota: Quota, *, limits: Limits) -> None:
        self._limits = limits
        self._rates = (quota.messages_per_s, quota.bytes_per_s)
        self._levels = [rate * BURST_S for rate in self._rates]
        self._at_s = -math.inf

    def batch(self, batch: link_pb2.Batch, delivery: str, now_s: float) -> float:
        """Take a batch, or the first piece of a large sample for the whole of it; 0, or seconds to wait."""
        if batch.chunk_index:
            return 0.0
        size_bytes = batch.ByteSize()
        if batch.chunk_count > 1:
            size_bytes = max(size_bytes, int.from_bytes(batch.lengths[:4], "little"))
        return self.take(batch.count, size_bytes, delivery, now_s)

    def take(self, messages: int, size_bytes: int, delivery: str, now_s: float) -> float:
        """Take so much if the bucket lets this class have it: 0, or after how many seconds it will."""
        self._fill(now_s)
        floor = FLOORS.get(delivery, 0.0)
        wait_s = 0.0
        for rate, level in zip(self._rates, self._levels, strict=True):
            if rate and level <= floor * rate * BURST_S:
                wait_s = max(wait_s, LEAST_WAIT_S, BURST_S / 2 - level / rate)
        if not wait_s:
            self._levels[0] -= min(messages, self._limits.batch_samples)
            self._levels[1] -= min(size_bytes, self._limits.sample_bytes)
        return min(wait_s, MOST_WAIT_S)

    def _fill(self, now_s: float) -> None:
        passed_s = max(0.0, now_s - self._at_s)
        self._at_s = now_s
        for index, rate in enumerate(self._rates):
            self._levels[index] = min(self._levels[index] + rate * passed_s, rate * BURST_S) if rate else 0.0
